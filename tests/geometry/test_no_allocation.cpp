// Nothing of the geometry room allocates: malloc itself is counted.

#include <catch2/catch.hpp>
#include <cstdlib>
#include <memory>

#include "estimator/geometry/alignment.hpp"
#include "estimator/geometry/triangulation.hpp"
#include "tests/geometry/track_scene.hpp"

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

namespace {
long allocation_count = 0;
}

extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) {
  ++allocation_count;
  return __libc_malloc(size);
}

namespace swiftlet::test {

TEST_CASE("the RANSACs, the triangulation and the alignments do not allocate", "[ransac]") {
  const Scene scene = makeScene(euroc(), {}, 1);
  const auto mono = std::make_unique<MonoRansac>();
  RansacResult result;
  Alignment alignment;
  const std::vector<SE3> poses = {SE3(), SE3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1, 0, 0))};

  const long control = allocation_count;
  free(malloc(8));
  const bool counting = allocation_count > control;

  const long before = allocation_count;
  const bool five = mono->fivePoint(scene.prev, scene.cur, 1, result).ok();
  const bool two = mono->twoPoint(scene.prev, scene.cur, scene.T_cur_prev.rotation, 1, result).ok();
  const bool aligned = alignSimilarity(scene.prev, scene.cur, alignment).ok();
  const Triangulation point = triangulate(std::span(scene.prev).first(2), poses);
  const long after = allocation_count;

  CHECK(counting);
  CHECK(after == before);
  CHECK((five && two && aligned));
  CHECK(point.state != TriangulationState::kInvalidInput);
}

}  // namespace swiftlet::test

#endif
