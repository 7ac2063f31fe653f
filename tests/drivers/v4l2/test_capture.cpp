// Two of the kernel's test cameras, streamed and paired; inside the sandbox.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "drivers/v4l2/camera_device.hpp"
#include "drivers/v4l2/camera_offers.hpp"
#include "tests/drivers/v4l2/stream.hpp"
#include "tests/drivers/v4l2/vivid.hpp"
#include "tests/support/sandbox.hpp"

namespace swiftlet {
namespace {

struct Seen {
  Stamp stamp;
  Stamp arrival;
  std::uint64_t sequence = 0;
};

constexpr std::int64_t kPeriodNs = 50'000'000;
// Test patterns without colour: the driver weighs red, green and blue differently for GREY and for YUYV.
constexpr int kGreyRamp = 20;
constexpr int kCheckersOfOnePixel = 12;

std::string cameraPath(int number) {
  return sandbox::device(number == 0 ? "SANDBOX_CAMERA0" : "SANDBOX_CAMERA1");
}

void startOfExposure(const std::string& path) { vivid::set(path, "Timestamp Source", 1); }

/// Pairs whose stamps lie within `tolerance`, both lists in order.
std::size_t pairs(const std::vector<Seen>& a, const std::vector<Seen>& b, Duration tolerance) {
  std::size_t found = 0;
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    const Duration apart = a[i].stamp - b[j].stamp;
    if (apart <= tolerance && -apart <= tolerance) ++found;
    const bool both = apart <= tolerance && -apart <= tolerance;
    if (both || apart.ns < 0) ++i;
    if (both || apart.ns > 0) ++j;
  }
  return found;
}

std::array<std::vector<Seen>, 2> streamBoth(std::array<CameraDevice, 2>& cameras, std::size_t count) {
  std::array<std::vector<Seen>, 2> seen;
  CapturedFrame frame;
  while (std::min(seen[0].size(), seen[1].size()) < count) {
    std::array<pollfd, 2> waiting = {{{cameras[0].fd(), POLLIN, 0}, {cameras[1].fd(), POLLIN, 0}}};
    REQUIRE(::poll(waiting.data(), waiting.size(), 2000) > 0);
    for (std::size_t c = 0; c < 2; ++c) {
      REQUIRE(cameras[c].next(frame).ok());
      if (frame.valid()) seen[c].push_back({frame.stamp, frame.arrival, frame.sequence});
    }
  }
  return seen;
}

TEST_CASE("Two cameras at 20 Hz: every frame comes, in pairs, and nothing is left open", "[capture]") {
  constexpr std::size_t kFrames = 400;
  const std::size_t files = sandbox::openFiles();
  for (int n = 0; n < 2; ++n) startOfExposure(cameraPath(n));
  {
    std::array<CameraDevice, 2> cameras;
    for (std::size_t n = 0; n < 2; ++n) {
      const DeviceFault fault = cameras[n].open(stream::settings(cameraPath(static_cast<int>(n))));
      INFO(describe(fault, "camera"));
      REQUIRE(fault.ok());
      CHECK(cameras[n].warnings().empty());
      CHECK(cameras[n].facts().rate == Approx(20));
      CHECK(cameras[n].facts().event == StampEvent::kStartOfExposure);
      CHECK(cameras[n].facts().buffers >= 4);
      CHECK(std::string(cameras[n].facts().driver.data()) == "vivid");
    }
    CHECK(sandbox::mappings("/dev/video") >= 8);
    const auto seen = streamBoth(cameras, kFrames);
    std::int64_t worst_step = 0;
    std::int64_t worst_delay = 0;
    for (const auto& list : seen) {
      for (std::size_t i = 1; i < list.size(); ++i) {
        REQUIRE(list[i].sequence == list[i - 1].sequence + 1);
        worst_step = std::max(worst_step, std::abs((list[i].stamp - list[i - 1].stamp).ns - kPeriodNs));
        worst_delay = std::max(worst_delay, (list[i].arrival - list[i].stamp).ns);
      }
    }
    const std::size_t paired = pairs(seen[0], seen[1], {kPeriodNs / 4});
    std::printf("two cameras, %zu frames each: %zu pairs, worst step off by %.3f ms, worst delay %.3f ms\n",
                kFrames, paired, 1e-6 * static_cast<double>(worst_step),
                1e-6 * static_cast<double>(worst_delay));
    // One may have started a frame before the other.
    CHECK(paired + 1 >= kFrames);
    for (const CameraDevice& camera : cameras) {
      CHECK(camera.counters().missed == 0);
      CHECK(camera.counters().damaged == 0);
      CHECK(camera.counters().stamp_ahead == 0);
      CHECK(camera.counters().requeue_failed == 0);
    }
  }
  CHECK(sandbox::openFiles() == files);
  CHECK(sandbox::mappings("/dev/video") == 0);
}

TEST_CASE("Two cameras at 20 Hz by this machine's clock", "[.real time]") {
  constexpr std::size_t kFrames = 100;
  std::array<CameraDevice, 2> cameras;
  for (int n = 0; n < 2; ++n) {
    startOfExposure(cameraPath(n));
    REQUIRE(cameras[static_cast<std::size_t>(n)].open(stream::settings(cameraPath(n))).ok());
  }
  const auto seen = streamBoth(cameras, kFrames);
  const std::size_t paired = pairs(seen[0], seen[1], {kPeriodNs / 4});
  const std::uint64_t missed = cameras[0].counters().missed + cameras[1].counters().missed;
  std::printf("by this machine's clock: %zu pairs of %zu frames, %llu missed\n", paired, kFrames,
              static_cast<unsigned long long>(missed));
  // A busy machine stalls the whole sandbox, the test camera's own thread with it.
  CHECK(missed <= 4);
  CHECK(paired + 5 >= kFrames);
  CHECK(cameras[0].counters().requeue_failed == 0);
}

TEST_CASE("Opened and closed a hundred times: nothing is left open", "[capture]") {
  const std::size_t files = sandbox::openFiles();
  const std::string path = cameraPath(0);
  for (int i = 0; i < 100; ++i) {
    CameraDevice camera;
    REQUIRE(camera.open(stream::settings(path)).ok());
    CapturedFrame frame;
    if (i % 10 == 0) {
      REQUIRE(stream::wait(camera, frame).ok());
      camera.close();
      frame.release();  // after its camera closed: goes nowhere
    }
  }
  CHECK(sandbox::openFiles() == files);
  CHECK(sandbox::mappings("/dev/video") == 0);
}

/// A sensor's grey picture behind a Bayer filter, as GreyReader reads it.
std::vector<std::uint8_t> smoothed(const std::vector<std::uint8_t>& grey, int width, int height) {
  const auto mirrored = [](int i, int size) { return i < 0 ? -i : i >= size ? 2 * size - 2 - i : i; };
  std::vector<std::uint8_t> out;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      int sum = 8;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          sum += (2 - std::abs(dx)) * (2 - std::abs(dy)) *
                 grey[static_cast<std::size_t>(mirrored(y + dy, height) * width + mirrored(x + dx, width))];
        }
      }
      out.push_back(static_cast<std::uint8_t>(sum / 16));
    }
  }
  return out;
}

TEST_CASE("Every format that is taken shows the same picture", "[capture][formats]") {
  const std::string path = cameraPath(0);
  const int pattern = GENERATE(kGreyRamp, kCheckersOfOnePixel);
  vivid::set(path, "Test Pattern", pattern);
  vivid::set(path, "OSD Text Mode", 2);  // no running clock in the picture
  const std::vector<std::uint8_t> reference = stream::oneGrey(stream::settings(path));
  CHECK(*std::max_element(reference.begin(), reference.end()) > 150);
  const std::vector<std::uint8_t> mosaic = smoothed(reference, 752, 480);
  const auto list = listCameras();
  int formats = 0;
  for (const FormatOffer& offer : list.at(0).formats) {
    if (!offer.taken) continue;
    ++formats;
    const char* format = offer.fourcc.c_str();
    INFO(format);
    const std::vector<std::uint8_t> other = stream::oneGrey(stream::settings(path, format));
    const bool limited = vivid::limitedRange(path);
    const std::vector<std::uint8_t>& picture = pixelFormat(format)->mosaic ? mosaic : reference;
    REQUIRE(other.size() == picture.size());
    int worst = 0;
    for (std::size_t i = 0; i < other.size(); ++i) {
      const double expected = limited ? 16 + picture[i] * 219.0 / 255 : picture[i];
      worst = std::max(worst, static_cast<int>(std::lround(std::abs(other[i] - expected))));
    }
    // The test picture is computed per format, each with its own rounding.
    std::printf("%s, pattern %d: at most %d levels from GREY\n", format, pattern, worst);
    CHECK(worst <= 1);
  }
  CHECK(formats >= 34);
  vivid::set(path, "Test Pattern", 0);
}

TEST_CASE("What is not asked for is chosen: grey before all", "[capture]") {
  CameraDevice camera;
  REQUIRE(camera.open(stream::settings(cameraPath(0), "")).ok());
  CHECK(camera.facts().format == kGrey8);
  CHECK(camera.facts().width == 752);
}

TEST_CASE("Gain is set by hand and read back; a clamped one is reported, an exposure it lacks too",
          "[capture]") {
  CameraDeviceSettings settings = stream::settings(cameraPath(0));
  settings.gain = 60;
  settings.exposure = Duration::fromMilliseconds(5);
  CameraDevice camera;
  REQUIRE(camera.open(settings).ok());
  CHECK(camera.facts().gain == 60);
  REQUIRE(camera.warnings().size() == 1);
  CHECK(camera.warnings()[0].kind == DeviceFaultKind::kUnsupported);
  CHECK(camera.warnings()[0].text().find("exposure") != std::string::npos);
  CHECK(!camera.facts().exposure);
  settings.gain = 5000;
  settings.exposure.reset();
  REQUIRE(camera.open(settings).ok());
  CHECK(camera.facts().gain == 255);
  REQUIRE(camera.warnings().size() == 1);
  CHECK(camera.warnings()[0].kind == DeviceFaultKind::kChanged);
  CHECK(camera.warnings()[0].text() == "gain: requested 5000, set 255");
}

TEST_CASE("A format, a size and a rate that it lacks are refused with what it offers", "[capture]") {
  const std::string path = cameraPath(0);
  CameraDevice camera;
  for (const auto& [letters, why] :
       {std::pair("MJPG", "is not offered"), std::pair("RGBP", "is not supported")}) {
    const DeviceFault format = camera.open(stream::settings(path, letters));
    std::printf("%s\n", describe(format, "camera 0 (" + path + ")").c_str());
    CHECK(format.kind == DeviceFaultKind::kUnsupported);
    CHECK(format.text().find(std::string(letters) + " " + why) != std::string::npos);
    CHECK(format.text().find("offers YUYV") != std::string::npos);
    CHECK(format.text().find(" GREY ") != std::string::npos);
  }
  const DeviceFault size = camera.open(stream::settings(path, "GREY", 700, 500));
  std::printf("%s\n", describe(size, "camera 0 (" + path + ")").c_str());
  CHECK(size.kind == DeviceFaultKind::kChanged);
  CHECK(size.text().find("requested 700x500") != std::string::npos);
  CHECK(size.text().find("GREY offers 320x180") != std::string::npos);
  CHECK(size.text().find(" 752x480") != std::string::npos);
  const DeviceFault rate = camera.open(stream::settings(path, "GREY", 752, 480, 21));
  std::printf("%s\n", describe(rate, "camera 0 (" + path + ")").c_str());
  CHECK(rate.kind == DeviceFaultKind::kChanged);
  CHECK(rate.text().find("requested 21") != std::string::npos);
  CHECK(rate.text().find(" 20 ") != std::string::npos);
  CHECK(!camera.isOpen());
}

TEST_CASE("A camera with an external trigger runs in the slowest mode that is fast enough", "[capture]") {
  CameraDevice camera;
  for (const auto& [asked, mode] : {std::pair(20.0, 20.0), {16.0, 20.0}, {21.0, 25.0}}) {
    CameraDeviceSettings settings = stream::settings(cameraPath(0), "GREY", 752, 480, asked);
    settings.triggered = true;
    REQUIRE(camera.open(settings).ok());
    CHECK(camera.facts().rate == Approx(mode));
    camera.close();
  }
  CameraDeviceSettings settings = stream::settings(cameraPath(0), "GREY", 752, 480, 400);
  settings.triggered = true;
  CHECK(camera.open(settings).kind == DeviceFaultKind::kChanged);
}

TEST_CASE("An output node is no camera, and a camera that streams is busy for others", "[capture]") {
  CameraDevice first;
  CameraDevice second;
  CHECK(first.open(stream::settings(sandbox::device("SANDBOX_OUTPUT0"))).kind ==
        DeviceFaultKind::kWrongDevice);
  REQUIRE(first.open(stream::settings(cameraPath(0))).ok());
  CHECK(second.open(stream::settings(cameraPath(0))).kind == DeviceFaultKind::kBusy);
  CHECK(second.open(stream::settings(cameraPath(1))).ok());
}

TEST_CASE("The list of cameras names them, their formats and sizes", "[capture]") {
  const std::vector<CameraListing> list = listCameras();
  REQUIRE(list.size() == 4);
  CHECK(list[0].path == "/dev/video0");
  CHECK(list[0].fault.ok());
  CHECK(list[0].driver == "vivid");
  const auto grey = std::find_if(list[0].formats.begin(), list[0].formats.end(),
                                 [](const FormatOffer& offer) { return offer.fourcc == "GREY"; });
  REQUIRE(grey != list[0].formats.end());
  CHECK(grey->taken);
  CHECK(std::count(grey->sizes.begin(), grey->sizes.end(), "752x480") == 1);
  CHECK(list[2].fault.kind == DeviceFaultKind::kWrongDevice);
}

TEST_CASE("Frames that are kept leave the driver without buffers: a hole that is counted", "[capture]") {
  CameraDevice camera;
  CameraDeviceSettings settings = stream::settings(cameraPath(0));
  settings.buffers = 4;
  REQUIRE(camera.open(settings).ok());
  std::array<CapturedFrame, 4> kept;
  std::vector<std::uint8_t> first;
  for (CapturedFrame& frame : kept) {
    REQUIRE(stream::wait(camera, frame).ok());
    REQUIRE(frame.valid());
    if (first.empty()) first = stream::grey(frame.image);
  }
  CapturedFrame none;
  REQUIRE(stream::wait(camera, none, 300).ok());
  CHECK(!none.valid());
  CHECK(stream::grey(kept[0].image) == first);
  for (CapturedFrame& frame : kept) frame.release();
  REQUIRE(stream::wait(camera, none).ok());
  CHECK(none.valid());
  CHECK(camera.counters().missed >= 5);
  CHECK(camera.counters().missed <= 8);
}

}  // namespace
}  // namespace swiftlet
