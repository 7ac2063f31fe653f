// Fusing, evicting and drawing allocate nothing after construction: malloc is counted.
#include <catch2/catch.hpp>
#include <cstddef>
#include <memory>
#include <vector>

#include "mapping/surface/surface_stage.hpp"
#include "tests/mapping/volume_scene.hpp"
#include "tests/support/counted_malloc.hpp"

#ifdef SWIFTLET_COUNTS_MALLOC

using namespace swiftlet;           // NOLINT(google-build-using-namespace)
using namespace swiftlet::testing;  // NOLINT(google-build-using-namespace)

TEST_CASE("the volume and its surface do not allocate") {
  REQUIRE(test::mallocIsCounted());

  VolumeSettings settings = sceneSettings();
  settings.memory_bytes = 120 * 8000;
  VoxelVolume volume(settings);
  VolumeIntegrator integrator(volume, kSceneCamera.pixels());
  const ConfusionModel confusion;
  SurfaceStore store(40 * 3000, settings.voxel_size * kBlockSide);
  const auto stage = std::make_unique<SurfaceStage>(volume, confusion, store);
  std::vector<SceneImage> images;
  std::vector<SE3> poses;
  for (int i = 0; i < 20; ++i) {
    poses.push_back(lookAt({1.5, 0.5 * i, 0}, {3, 0.5 * i, 0}));
    images.push_back(render(poses.back(), 1 + i, Plane{{-1, 0, 0}, -3}));
    images.back().labels.assign(images.back().depth.size(), 4);
    images.back().grey.assign(images.back().depth.size(), 4);
  }
  VolumeStep fused;
  SurfaceStep drawn;
  const long before = test::malloc_calls;
  for (std::size_t i = 0; i < images.size(); ++i) {
    (void)integrator.step(images[i].view(), poses[i], {}, fused);
    (void)stage->step(poses[i].translation.cast<float>(), {}, drawn);
  }
  const long after = test::malloc_calls;
  CHECK(after == before);
  CHECK(volume.counters().evicted > 0);
  CHECK(store.counters().dropped > 0);
}

#endif
