// A camera's thread: where it runs, and a camera that comes back as another.

#include <atomic>
#include <catch2/catch.hpp>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "firmware_host/inputs/devices/camera_thread.hpp"
#include "tests/firmware_host/live/imu_bench.hpp"

namespace swiftlet {
namespace {

using test::soon;

/// A camera that opens with the format that it is told to, and goes when it is told to.
class ToldCamera : public CameraSource {
 public:
  std::atomic<const char*> format{"GREY"};
  std::atomic<bool> goes{false};
  bool of_library = false;

  DeviceFault open() override {
    goes.store(false);
    open_ = true;
    facts_ = {};
    facts_.format = *pixelFormat(format.load());
    facts_.width = 64;
    facts_.height = 48;
    return {};
  }
  void close() override { open_ = false; }
  [[nodiscard]] bool isOpen() const override { return open_; }
  [[nodiscard]] int fd() const override { return -1; }
  [[nodiscard]] bool allocates() const override { return of_library; }
  DeviceFault next(CapturedFrame& frame) override {
    frame.release();
    if (!goes.load()) return {};
    close();
    return deviceFault(DeviceFaultKind::kUnplugged, 0, "told to");
  }

 private:
  void giveBack(std::uint32_t /*buffer*/) override {}
  bool open_ = false;
};

SensorInput::Level levelOf(const char* format, bool of_library) {
  auto camera = std::make_unique<ToldCamera>();
  camera->format = format;
  camera->of_library = of_library;
  CameraThread thread({"camera 0", 0, {}, {}}, std::move(camera));
  REQUIRE(thread.open().ok());
  return thread.level();
}

TEST_CASE("a camera's thread stands below the flight path where its library or codec allocates") {
  CHECK(levelOf("GREY", false) == SensorInput::Level::kSensor);
  CHECK(levelOf("YUYV", false) == SensorInput::Level::kSensor);
  CHECK(levelOf("MJPG", false) == SensorInput::Level::kLibrary);
  CHECK(levelOf("JPEG", false) == SensorInput::Level::kLibrary);
  CHECK(levelOf("GREY", true) == SensorInput::Level::kLibrary);
}

TEST_CASE("a camera that comes back with other pixels is refused until it has the right ones") {
  auto owned = std::make_unique<ToldCamera>();
  ToldCamera& camera = *owned;
  CameraThread thread({"camera 0", 0, {}, {}}, std::move(owned));
  REQUIRE(thread.open().ok());
  std::atomic<bool> stop{false};
  RunControl control;
  control.stop = &stop;
  test::KeepingSink sink;
  std::thread runner([&] { thread.run(sink, control); });
  std::vector<std::string> lines;
  const auto said = [&](const std::string& part) {
    DeviceEvent event;
    while (thread.journal().next(event)) lines.push_back(thread.journal().text(event));
    for (const std::string& line : lines) {
      if (line.find(part) != std::string::npos) return true;
    }
    return false;
  };
  camera.format = "YUYV";
  camera.goes = true;
  CHECK(soon([&] { return said("reopened with 64x48 YUYV instead of 64x48 GREY"); }));
  camera.format = "GREY";
  CHECK(soon([&] { return !camera.goes.load() && camera.facts().format == kGrey8; }));
  stop.store(true);
  runner.join();
}

}  // namespace
}  // namespace swiftlet
