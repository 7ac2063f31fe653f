// Images written to output nodes come out of capture nodes; inside the sandbox with looping cameras.
#include <catch2/catch.hpp>

#include <array>
#include <cstdio>
#include <string>
#include <vector>

#include "drivers/v4l2/camera_device.hpp"
#include "drivers/v4l2/video_output.hpp"
#include "estimator/core/random.hpp"
#include "tests/drivers/v4l2/stream.hpp"
#include "tests/support/sandbox.hpp"

namespace swiftlet {
namespace {

constexpr int kWidth = 752;
constexpr int kHeight = 480;
constexpr std::size_t kPixels = std::size_t{kWidth} * kHeight;

std::vector<std::uint8_t> noise(std::uint64_t seed) {
  std::vector<std::uint8_t> image(kPixels);
  Random random(seed, 0);
  for (std::uint8_t& pixel : image) pixel = static_cast<std::uint8_t>(random.below(256));
  return image;
}

ImageView view(const std::vector<std::uint8_t>& image) { return {image.data(), kWidth, kHeight, kWidth}; }

struct Loop {
  VideoOutput output;
  CameraDevice camera;
  std::vector<std::vector<std::uint8_t>> images;
  std::size_t written = 0;
  std::size_t next_seen = 0;  ///< images that came out so far
  std::size_t repeated = 0;
  std::size_t foreign = 0;  ///< frames between the first and the last image that are none of ours

  void write() {
    while (written < images.size() + VideoOutput::kHeldBack && output.canWrite()) {
      REQUIRE(output.write(view(images[std::min(written, images.size() - 1)])).ok());
      ++written;
    }
  }
  void look() {
    CapturedFrame frame;
    REQUIRE(camera.next(frame).ok());
    if (!frame.valid()) return;
    const std::vector<std::uint8_t> seen = stream::grey(frame.image);
    if (next_seen < images.size() && seen == images[next_seen]) {
      ++next_seen;
    } else if (next_seen > 0 && seen == images[next_seen - 1]) {
      ++repeated;
    } else if (next_seen > 0 && next_seen < images.size()) {
      ++foreign;
    }
  }
};

TEST_CASE("Images pass from two output nodes to two cameras unchanged, each once and in order", "[loop]") {
  constexpr std::size_t kImages = 60;
  std::array<Loop, 2> loops;
  const std::array<const char*, 2> cameras = {"SANDBOX_CAMERA0", "SANDBOX_CAMERA1"};
  const std::array<const char*, 2> outputs = {"SANDBOX_OUTPUT0", "SANDBOX_OUTPUT1"};
  for (std::size_t n = 0; n < 2; ++n) {
    for (std::size_t i = 0; i < kImages; ++i) loops[n].images.push_back(noise(100 * n + i + 1));
    const DeviceFault fault = loops[n].camera.open(stream::settings(sandbox::device(cameras[n])));
    INFO(describe(fault, cameras[n]));
    REQUIRE(fault.ok());
    CHECK(loops[n].camera.facts().rate == Approx(20));
    REQUIRE(loops[n].output.open(sandbox::device(outputs[n]).c_str(), kWidth, kHeight).ok());
  }
  ::poll(nullptr, 0, 200);
  for (int turn = 0; turn < 4000; ++turn) {
    for (Loop& loop : loops) {
      loop.write();
      loop.look();
    }
    if (loops[0].next_seen == kImages && loops[1].next_seen == kImages) break;
    ::poll(nullptr, 0, 2);
  }
  for (const Loop& loop : loops) {
    std::printf("loop: %zu of %zu images seen, %zu repeated, %zu foreign\n", loop.next_seen, kImages,
                loop.repeated, loop.foreign);
    CHECK(loop.next_seen == kImages);
    CHECK(loop.repeated <= VideoOutput::kHeldBack);
    CHECK(loop.foreign == 0);
    CHECK(loop.camera.counters().missed == 0);
  }
}

TEST_CASE("An image of the wrong size, and one too many, are refused", "[loop]") {
  VideoOutput output;
  REQUIRE(output.open(sandbox::device("SANDBOX_OUTPUT0").c_str(), kWidth, kHeight).ok());
  const std::vector<std::uint8_t> image = noise(1);
  CHECK(output.write({image.data(), 640, 480, 640}).kind == DeviceFaultKind::kUnsupported);
  int written = 0;
  DeviceFault fault;
  for (; written < 100 && fault.ok(); ++written) fault = output.write(view(image));
  CHECK(fault.kind == DeviceFaultKind::kBusy);
  CHECK(written <= 10);
  CHECK(output.queued() >= 2);
}

}  // namespace
}  // namespace swiftlet
