// Nothing of the geometry room allocates: malloc itself is counted.

#include <catch2/catch.hpp>
#include <memory>

#include "estimator/geometry/alignment.hpp"
#include "estimator/geometry/triangulation.hpp"
#include "tests/geometry/track_scene.hpp"
#include "tests/support/counted_malloc.hpp"

#ifdef SWIFTLET_COUNTS_MALLOC

namespace swiftlet::test {

TEST_CASE("the RANSACs, the triangulation and the alignments do not allocate", "[ransac]") {
  const Scene scene = makeScene(euroc(), {}, 1);
  const auto mono = std::make_unique<MonoRansac>();
  RansacResult result;
  Alignment alignment;
  const std::vector<SE3> poses = {SE3(), SE3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1, 0, 0))};

  const bool counting = mallocIsCounted();

  const long before = malloc_calls;
  const bool five = mono->fivePoint(scene.prev, scene.cur, 1, result).ok();
  const bool two = mono->twoPoint(scene.prev, scene.cur, scene.T_cur_prev.rotation, 1, result).ok();
  const bool aligned = alignSimilarity(scene.prev, scene.cur, alignment).ok();
  const Triangulation point = triangulate(std::span(scene.prev).first(2), poses);
  const long after = malloc_calls;

  CHECK(counting);
  CHECK(after == before);
  CHECK((five && two && aligned));
  CHECK(point.state != TriangulationState::kInvalidInput);
}

}  // namespace swiftlet::test

#endif
