// Depth stages allocate nothing after construction: malloc is counted.
#include <catch2/catch.hpp>
#include <cstddef>
#include <vector>

#include "estimator/core/random.hpp"
#include "mapping/depth/depth_stage.hpp"
#include "mapping/depth/sensor_depth.hpp"
#include "tests/mapping/depth_scene.hpp"
#include "tests/support/counted_malloc.hpp"

#ifdef SWIFTLET_COUNTS_MALLOC

using namespace swiftlet;

TEST_CASE("depth: steps do not allocate") {
  REQUIRE(test::mallocIsCounted());

  const Rig rig = depth_scene::makeRig(CameraKind::kPinholeRadtan);
  DepthStage stage(rig);
  REQUIRE(stage.status().ok());
  DepthBuffer out = stage.makeBuffer();
  SensorDepth sensor(stage.rectification().intrinsics(), stage.rectification().T_body_camera());
  DepthBuffer sensor_out = sensor.makeBuffer();
  // Noise: every pixel a run of its own for the speckle filter.
  Random random(1);
  const std::size_t pixels = stage.rectification().intrinsics().pixels();
  std::vector<std::uint8_t> left(pixels), right(pixels);
  std::vector<std::uint16_t> counts(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    left[i] = static_cast<std::uint8_t>(random.below(256));
    right[i] = static_cast<std::uint8_t>(random.below(256));
    counts[i] = static_cast<std::uint16_t>(random.below(12000));
  }
  const int width = rig.camera[0].width(), height = rig.camera[0].height();
  const ImageView l{left.data(), width, height, width}, r{right.data(), width, height, width};
  for (int round = 0; round < 2; ++round) {
    const long before = test::malloc_calls;
    const Status stepped = stage.step(l, r, Stamp{1}, {}, out);
    const Status labelled = stage.addLabels(l, out);
    const Status sensed = sensor.step(counts.data(), width, height, width, Stamp{1}, sensor_out);
    const Status refused = stage.step(l, {}, Stamp{2}, {}, out);
    const long after = test::malloc_calls;
    CHECK(stepped.ok());
    CHECK(labelled.ok());
    CHECK(sensed.ok());
    CHECK_FALSE(refused.ok());
    CHECK(after == before);
  }
}

#endif
