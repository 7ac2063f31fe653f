// What an image makes free: nothing that its unmeasured pixels may hide, and all that they cannot.
#include <algorithm>
#include <catch2/catch.hpp>

#include "tests/mapping/volume_scene.hpp"

using namespace swiftlet;           // NOLINT(google-build-using-namespace)
using namespace swiftlet::testing;  // NOLINT(google-build-using-namespace)

namespace {

const Plane kFarWall{{-1, 0, 0}, -3};  // x = 3, seen from below it
const SE3 kFromOrigin = lookAt({0, 0, 0}, {1, 0, 0});

struct View {
  explicit View(const VolumeSettings& settings = sceneSettings())
      : volume(settings), integrator(volume, kSceneCamera.pixels()) {}
  void add(SceneImage image, const float* sigma = nullptr, const SE3& pose = kFromOrigin) {
    stamp += 1;
    image.stamp = {1'000'000'000LL * stamp};
    DepthImageView with_sigma = image.view();
    with_sigma.sigma = sigma;
    VolumeStep step;
    REQUIRE(integrator.step(with_sigma, pose, {}, step).ok());
  }
  /// The voxel at `p` is known and in front of all surface.
  [[nodiscard]] bool isFree(const Eigen::Vector3d& p) const {
    float distance = 0;
    return volume.distanceAt(volume.voxelAt(p), distance) && distance > 0;
  }
  VoxelVolume volume;
  VolumeIntegrator integrator;
  int stamp = 0;
};

/// The columns of a pole that gives no depth, about the middle of the image.
struct Stripe {
  int first = 0, width = 0;
  [[nodiscard]] bool holds(int u) const { return u >= first && u < first + width; }
};

SceneImage withStripe(SceneImage image, const Stripe& stripe, float depth) {
  for (std::size_t i = 0; i < image.depth.size(); ++i) {
    if (stripe.holds(static_cast<int>(i) % image.camera.width)) image.depth[i] = depth;
  }
  return image;
}

/// f(centre, its column) for the voxels between 0.4 and 2.5 m whose centres are seen.
template <typename F>
void forSeen(const VoxelVolume& volume, const F& f) {
  const double size = volume.settings().voxel_size;
  const auto centre = [size](int i) { return size * (i + 0.5); };
  for (int x = 8; x < 50; ++x) {
    for (int y = -30; y < 30; ++y) {
      for (int z = -15; z < 15; ++z) {
        const Eigen::Vector3d c = kFromOrigin.inverse() * Eigen::Vector3d(centre(x), centre(y), centre(z));
        const double u = kSceneCamera.fx * c.x() / c.z() + kSceneCamera.cx + 0.5;
        const double v = kSceneCamera.fy * c.y() / c.z() + kSceneCamera.cy + 0.5;
        if (std::min({u, v, kSceneCamera.width - u, kSceneCamera.height - v}) < 8) continue;
        f(Eigen::Vector3d(centre(x), centre(y), centre(z)), static_cast<int>(u));
      }
    }
  }
}

}  // namespace

TEST_CASE("a pole that gives no depth is not free, however thin") {
  for (const Stripe stripe : {Stripe{61, 1}, Stripe{61, 2}, Stripe{61, 3}, Stripe{60, 4}, Stripe{60, 8}}) {
    INFO(stripe.width << " pixels");
    View view;
    for (int i = 0; i < 5; ++i) view.add(withStripe(render(kFromOrigin, 1, kFarWall), stripe, 0));
    std::size_t free_in_shadow = 0, free = 0;
    forSeen(view.volume, [&](const Eigen::Vector3d& p, int column) {
      if (view.isFree(p)) (stripe.holds(column) ? free_in_shadow : free) += 1;
    });
    CHECK(free_in_shadow == 0);
    CHECK(free > 10000);
  }
}

TEST_CASE("a pole that is in the map stays where images do not measure it") {
  const Stripe pole{76, 8};
  View view;
  for (int i = 0; i < 5; ++i) view.add(withStripe(render(kFromOrigin, 1, kFarWall), pole, 0.9F));
  const Eigen::Vector3d inside(0.93, 0.02, 0.02);
  REQUIRE_FALSE(view.isFree(inside));
  for (int i = 0; i < 30; ++i) view.add(withStripe(render(kFromOrigin, 1, kFarWall), pole, 0));
  CHECK_FALSE(view.isFree(inside));
}

TEST_CASE("single pixels without depth hide nothing") {
  View whole, gaps;
  SceneImage image = render(kFromOrigin, 1, kFarWall);
  whole.add(image);
  for (int v = 1; v < image.camera.height; v += 3) {
    for (int u = 1; u < image.camera.width; u += 3)
      image.depth[static_cast<std::size_t>(v * image.camera.width + u)] = 0;
  }
  gaps.add(image);
  CHECK(gaps.volume.freeCount() == whole.volume.freeCount());
}

TEST_CASE("what is beyond the range is free up to it, less three sigma") {
  VolumeSettings settings = sceneSettings();
  settings.most_range = 2;
  const SceneImage image = render(kFromOrigin, 1, kFarWall);
  for (const float sigma : {0.05F, 0.6F}) {
    View view(settings);
    const std::vector<float> sigmas(image.depth.size(), sigma);
    view.add(image, sigmas.data());
    CHECK(view.volume.blockCount() == 0);
    CHECK(view.isFree({0.8, 0, 0}));
    CHECK(view.isFree({1.6, 0, 0}) == (sigma < 0.1F));
    CHECK_FALSE(view.isFree({2.2, 0, 0}));
  }
}

TEST_CASE("a pole that is measured, thinner than a voxel, is not free") {
  for (const double distance : {1.32, 2.02}) {
    for (const double side : {-0.02, -0.01, 0.0, 0.01, 0.02}) {
      // From the middle of a voxel.
      const double y = 0.125 + side;
      const auto pole_before_wall = [&](const Eigen::Vector3d& o, const Eigen::Vector3d& r) {
        const double t = (distance - o.x()) / r.x();
        return std::abs(o.y() + t * r.y() - y) < 0.012 ? t : kFarWall(o, r);
      };
      View view;
      for (int i = 0; i < 10; ++i) view.add(render(kFromOrigin, 1, pole_before_wall));
      int free = 0;
      for (int i = -8; i < 8; ++i) free += view.isFree({distance, y, 0.05 * i + 0.01}) ? 1 : 0;
      INFO("at " << distance << " m, " << side << " m from the middle of a voxel");
      CHECK(free == 0);
    }
  }
}
