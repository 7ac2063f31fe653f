// Images that turn out to have been seen from elsewhere: the volume becomes what it would have been, in steps
// of bounded work, with nothing fused twice.

#include "mapping/map/volume_correction.hpp"

#include <catch2/catch.hpp>
#include <vector>

#include "mapping/surface/surface_stage.hpp"
#include "tests/mapping/volume_scene.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

namespace {

const Ball kBall{{0.03, -0.02, 0.01}, 1.0};
const std::vector<SE3> kViews = viewsAround(kBall, 2.5);
/// Kept are every third pixel of every third row, which here are as wide apart as voxels.
constexpr double kCoarser = 2;
/// And edges of the ball fall to one side or the other. Half the images fused twice would be 0.5.
constexpr double kWeightShare = 0.12;
/// The first frame of the half that is out of place, and by how much.
constexpr std::size_t kMoved = 13;
const SE3 kWrong{Eigen::Quaterniond::Identity(), {0.15, -0.1, 0.05}};

struct Map {
  explicit Map(std::size_t bytes = std::size_t{4} << 20U)
      : volume(sceneSettings()),
        integrator(volume, kSceneCamera.pixels()),
        confusion(kLabelValues, 0.9F),
        store(std::size_t{4} << 20U, volume.blockSize()),
        surface(volume, confusion, store),
        correction(volume, integrator, store, bytes, kSceneCamera.pixels()) {}

  void fuse(std::size_t i, const SE3& T_map_world = {}) {
    const SceneImage image = render(kViews[i], static_cast<double>(i + 1), kBall);
    VolumeStep step;
    integrator.restart();  // views are far apart
    REQUIRE(integrator.step(image.view(), T_map_world * kViews[i], {}, step).ok());
    correction.keep(image.view(), i, T_map_world, kViews[i]);
  }
  void fuseAll(const SE3& second_half) {
    for (std::size_t i = 0; i < kViews.size(); ++i) fuse(i, i < kMoved ? SE3{} : second_half);
  }
  void settle() {
    CorrectionStep step;
    while (correction.busy()) correction.step({0, 0, 0}, {}, step);
  }
  /// Mean distance of the surface's vertices from the ball's [m].
  double meanError() {
    SurfaceStep step;
    REQUIRE(surface.step({0, 0, 0}, {}, step).ok());
    struct Sum : SurfaceSink {
      void take(const SurfacePatch& patch) override {
        for (const SurfaceVertex& vertex : patch.vertices) {
          sum += std::abs((vertex.p_world.cast<double>() - kBall.centre).norm() - kBall.radius);
          ++count;
        }
      }
      double sum = 0;
      int count = 0;
    } sum;
    SurfacePatch scratch;
    store.visit(sum, scratch);
    REQUIRE(sum.count > 500);
    return sum.sum / sum.count;
  }
  [[nodiscard]] double weights() const {
    double sum = 0;
    for (std::uint32_t slot = 0; slot < volume.slots(); ++slot) {
      const VoxelBlock* block = volume.voxels(slot);
      for (std::size_t i = 0; block != nullptr && i < kBlockVoxels; ++i) {
        // Near the surface: what is free depends on what else a block holds.
        if (std::abs(block->distance[i]) < kDistanceSteps / 2) sum += block->weight[i];
      }
    }
    return sum;
  }

  VoxelVolume volume;
  VolumeIntegrator integrator;
  ConfusionModel confusion;
  SurfaceStore store;
  SurfaceStage surface;
  VolumeCorrection correction;
};

/// What loop closure says: the second half is in place after all.
std::vector<WorldInMap> rightWorlds() {
  return {{0, SE3{}}, {kMoved - 1, SE3{}}, {kMoved, SE3{}}, {kViews.size() - 1, SE3{}}};
}

}  // namespace

TEST_CASE("a volume half of whose images were out of place becomes as if they had not been") {
  Map right, wrong;
  right.fuseAll({});
  wrong.fuseAll(kWrong);
  const double right_error = right.meanError();
  CHECK(wrong.meanError() > 5 * right_error);

  wrong.correction.correct(rightWorlds());
  REQUIRE(wrong.correction.busy());
  CHECK(wrong.correction.counters().images_moved == kViews.size() - kMoved);
  wrong.settle();
  CHECK(wrong.meanError() < kCoarser * right_error);
  // Nothing is missing, and nothing in twice.
  CHECK(wrong.weights() == Approx(right.weights()).epsilon(kWeightShare));
}

TEST_CASE("poses that the smoother refines move what was fused from them") {
  Map map;
  map.fuseAll({});
  const double right_error = map.meanError();
  // All of it moves, and with it the ball.
  std::vector<RefinedPose> poses;
  const SE3 shift(Eigen::Quaterniond::Identity(), {0.1, 0, 0});
  for (std::size_t i = 0; i < kViews.size(); ++i) poses.push_back({i, shift * kViews[i]});
  map.correction.refine(poses);
  REQUIRE(map.correction.busy());
  map.settle();
  CHECK(map.meanError() > 3 * right_error);
  for (std::size_t i = 0; i < kViews.size(); ++i) poses[i].T_world_body = kViews[i];
  map.correction.refine(poses);
  map.settle();
  CHECK(map.meanError() < kCoarser * right_error);
}

TEST_CASE("between two keyframes the world moves evenly; before the first and after the last as these") {
  Map map;
  map.fuseAll({});
  const SE3 far(Eigen::Quaterniond::Identity(), {0.4, 0, 0});
  map.correction.correct(std::vector<WorldInMap>{{5, SE3{}}, {9, far}});
  const KeptDepths& kept = map.correction.kept();
  REQUIRE(kept.size() == kViews.size());
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const double part = std::clamp((static_cast<double>(kept.frame(i).frame) - 5) / 4, 0.0, 1.0);
    CHECK(kept.frame(i).T_map_world.translation.x() == Approx(0.4 * part).margin(1e-9));
  }
}

TEST_CASE("less than half a voxel is left as it is; an empty correction too") {
  Map map;
  map.fuseAll({});
  const SE3 little(Eigen::Quaterniond::Identity(), {0.4 * sceneSettings().voxel_size, 0, 0});
  map.correction.correct(std::vector<WorldInMap>{{0, little}});
  CHECK_FALSE(map.correction.busy());
  map.correction.correct({});
  CHECK_FALSE(map.correction.busy());
  CHECK(map.correction.counters().corrections == 0);
}

TEST_CASE("a step begins no image beyond its effort, and images to come are fused meanwhile") {
  Map map;
  for (std::size_t i = 0; i + 1 < kViews.size(); ++i) map.fuse(i, i < kMoved ? SE3{} : kWrong);
  map.correction.correct(rightWorlds());
  CorrectionStep step;
  map.correction.step({0, 0, 0}, {.blocks = 1}, step);
  CHECK(step.images == 1);
  const std::uint32_t waiting = step.waiting;
  REQUIRE(waiting > 1);
  map.fuse(kViews.size() - 1);
  map.correction.step({0, 0, 0}, {.blocks = 1}, step);
  CHECK(step.images == 1);
  CHECK(step.waiting == waiting - 1);
  map.settle();
  Map right;
  right.fuseAll({});
  CHECK(map.meanError() < kCoarser * right.meanError());
  CHECK(map.weights() == Approx(right.weights()).epsilon(kWeightShare));
}

TEST_CASE("a second correction before the first is done ends where both lead") {
  Map right, map;
  right.fuseAll({});
  map.fuseAll(kWrong);
  const SE3 other(Eigen::Quaterniond::Identity(), {-0.2, 0.1, 0});
  map.correction.correct(std::vector<WorldInMap>{{0, SE3{}}, {kMoved - 1, SE3{}}, {kMoved, other}});
  CorrectionStep step;
  map.correction.step({0, 0, 0}, {.blocks = 100}, step);
  REQUIRE(map.correction.busy());
  map.correction.correct(rightWorlds());
  map.settle();
  CHECK(map.meanError() < kCoarser * right.meanError());
  CHECK(map.weights() == Approx(right.weights()).epsilon(kWeightShare));
}

TEST_CASE("what was seen from a place that nobody was at leaves no surface there") {
  Map map;
  const SE3 astray(Eigen::Quaterniond::Identity(), {30, 0, 0});
  map.fuse(0, astray);
  SurfaceStep step;
  REQUIRE(map.surface.step({0, 0, 0}, {}, step).ok());
  map.correction.correct(std::vector<WorldInMap>{{0, SE3{}}});
  map.settle();
  REQUIRE(map.surface.step({0, 0, 0}, {}, step).ok());
  SurfacePatch patch;
  int near = 0, far = 0;
  for (std::uint32_t entry = 0; entry < map.store.entries(); ++entry) {
    if (!map.store.read(entry, patch)) continue;
    (patch.vertices[0].p_world.x() > 20 ? far : near) += 1;
  }
  CHECK(near > 0);
  CHECK(far == 0);
}

TEST_CASE("when the store is full the frame goes that another is most like, the older of the two") {
  const SceneImage image = render(kViews[0], 1, kBall);
  // Six frames and a bit.
  const std::size_t bytes = 6 * (5 * (kSceneCamera.pixels() / 9 + 301) + sizeof(KeptFrame)) + 4000;
  KeptDepths kept(bytes, kSceneCamera.pixels(), 10);
  REQUIRE(kept.capacity() == 6);
  KeptFrame about;
  for (std::uint64_t i = 0; i < 6; ++i) {
    about.frame = i;
    // Frame 3 is where frame 1 was.
    about.T_map_fused.translation.x() = static_cast<double>(i == 3 ? 1 : i);
    CHECK(kept.keep(image.view(), about) == i);
  }
  about.frame = 6;
  about.T_map_fused.translation.x() = 10;
  CHECK(kept.keep(image.view(), about) == 1);
  CHECK(kept.given_up() == 1);
  CHECK(kept.frame(1).frame == 6);
  CHECK(kept.frame(3).frame == 3);
}

TEST_CASE("a kept image is every third pixel of the one it was") {
  SceneImage image = render(kViews[3], 1, kBall);
  image.grey.assign(kSceneCamera.pixels(), 77);
  image.depth[0] = 50;  // beyond the range: says what is free
  image.depth[3] = 0;
  KeptDepths kept(std::size_t{1} << 20U, kSceneCamera.pixels(), 10);
  REQUIRE(kept.keep(image.view(), {}) == 0);
  const DepthImageView view = kept.read(0);
  REQUIRE(view.camera.width == 54);
  REQUIRE(view.camera.height == 40);
  CHECK(view.sigma == nullptr);
  CHECK(view.labels == nullptr);
  CHECK(view.intensity[5] == 77);
  CHECK(view.depth[0] > 10);
  CHECK(view.depth[1] == 0);
  for (int v = 0; v < 40; ++v) {
    for (int u = 2; u < 54; ++u) {
      const float was = image.depth[static_cast<std::size_t>(3 * v * 160 + 3 * u)];
      CHECK(std::abs(view.depth[static_cast<std::size_t>(v * 54 + u)] - was) < 2e-4F);
    }
  }
  // The same ray through the same pixel.
  const double ray = (view.camera.width - 1 - view.camera.cx) / view.camera.fx;
  CHECK(ray == Approx((159 - kSceneCamera.cx) / kSceneCamera.fx));
}
