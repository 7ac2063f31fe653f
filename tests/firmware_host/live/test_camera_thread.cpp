// A camera's thread: where it runs, a camera that comes back as another, and edges of a trigger.

#include <algorithm>
#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/device/monotonic_now.hpp"
#include "firmware_host/inputs/devices/camera_thread.hpp"
#include "tests/firmware_host/live/imu_bench.hpp"

namespace swiftlet {
namespace {

using test::soon;

/// A camera that opens with the format that it is told to, and goes when it is told to.
class ToldCamera : public CameraSource {
 public:
  std::atomic<const char*> format{"GREY"};
  std::atomic<const char*> opened{nullptr};  ///< format with which it opened last
  std::atomic<bool> goes{false};
  bool of_library = false;

  DeviceFault open() override {
    goes.store(false);
    open_ = true;
    facts_ = {};
    const char* const name = format.load();
    facts_.format = *pixelFormat(name);
    facts_.width = 64;
    facts_.height = 48;
    opened.store(name);
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
  const char* const grey = "GREY";
  camera.format = grey;
  CHECK(soon([&] { return camera.opened.load() == grey; }));
  stop.store(true);
  runner.join();
  CHECK(camera.facts().format == kGrey8);
}

/// Gives small images, each of another grey.
class GreyCamera : public CameraSource {
 public:
  [[nodiscard]] int fd() const override { return -1; }

 protected:
  void describe(StampEvent event, std::optional<Duration> exposure) {
    facts_ = {};
    facts_.width = facts_.stride = facts_.height = kSide;
    facts_.event = event;
    facts_.exposure = exposure;
  }
  void give(CapturedFrame& frame, Stamp stamp) {
    pixels_.fill(static_cast<std::uint8_t>(50 + number_ % 100));
    frame.image = {pixels_.data(), kSide, kSide, kSide};
    frame.event = facts_.event;
    frame.stamp = frame.arrival = stamp;
    frame.sequence = number_++;
    lend(frame, 0);
  }
  std::uint64_t number_ = 0;  ///< of the next image

 private:
  static constexpr int kSide = 32;
  void giveBack(std::uint32_t /*buffer*/) override {}
  std::array<std::uint8_t, static_cast<std::size_t>(kSide* kSide)> pixels_{};
};

/// Sends whenever it is asked, until it is told to stall. Reopening ends a stall unless it is hopeless.
class StallingCamera : public GreyCamera {
 public:
  std::atomic<int> opened{0};
  std::atomic<bool> stalls{false};  ///< until the next open
  std::atomic<bool> hopeless{false};
  std::atomic<std::int64_t> exposure{5'000'000};  ///< ns, from the next open on
  std::atomic<bool> warns{false};

  DeviceFault open() override {
    warning_count_ = 0;
    ++opened;
    stalls.store(hopeless.load());
    open_ = true;
    describe(StampEvent::kStartOfExposure, Duration{exposure.load()});
    if (warns.load()) warn(deviceFault(DeviceFaultKind::kFailed, 0, "auto exposure stays on"));
    return {};
  }
  void close() override {
    open_ = false;
    forgetLent();
  }
  [[nodiscard]] bool isOpen() const override { return open_; }
  DeviceFault next(CapturedFrame& frame) override {
    frame.release();
    if (open_ && !stalls.load() && asked_++ % 2 == 0) give(frame, monotonicNow());
    return {};
  }

 private:
  bool open_ = false;
  std::uint64_t asked_ = 0;
};

class CountingImages : public SensorSink {
 public:
  void takeImu(const ImuSample& /*sample*/, Stamp /*arrival*/, const HostTimes& /*host*/) override {}
  void takeScene(const SceneImages& /*scene*/) override {}
  void takeImage(const CameraFrame& image, const HostTimes& /*host*/) override {
    shift.store((image.stamp - image.arrival).ns);
    ++count;
  }
  std::atomic<std::uint64_t> count{0};
  std::atomic<std::int64_t> shift{0};  ///< of the newest: from the driver's stamp to the image's [ns]
};

/// A thread at work on a StallingCamera.
struct Stalling {
  Stalling() {
    auto owned = std::make_unique<StallingCamera>();
    camera = owned.get();
    CameraThread::Setup setup;
    setup.name = "camera 0";
    setup.settings.rate_hz = 20;
    setup.settings.exposure_ms = 5;
    thread.emplace(setup, std::move(owned));
    REQUIRE(thread->open().ok());
    control.stop = &stop;
    runner = std::thread([this] { thread->run(sink, control); });
    CHECK(soon([this] { return sink.count.load() > 2; }));
  }
  ~Stalling() {
    stop.store(true);
    runner.join();
  }
  std::size_t linesWith(const std::string& part) {
    DeviceEvent event;
    while (thread->journal().next(event)) lines.push_back(thread->journal().text(event));
    std::size_t count = 0;
    for (const std::string& line : lines) count += line.find(part) != std::string::npos ? 1 : 0;
    return count;
  }
  StallingCamera* camera = nullptr;
  std::optional<CameraThread> thread;
  CountingImages sink;
  std::atomic<bool> stop{false};
  RunControl control;
  std::vector<std::string> lines;
  std::thread runner;
};

TEST_CASE("a stream that stalls is restarted") {
  Stalling bench;
  bench.camera->stalls = true;
  CHECK(soon([&] { return bench.camera->opened.load() == 2; }));
  const std::uint64_t before = bench.sink.count.load();
  CHECK(soon([&] { return bench.sink.count.load() > before + 2; }));
  CHECK(soon([&] { return bench.linesWith("works again") == 1; }));
  CHECK(bench.linesWith("no frame for") == 1);
}

TEST_CASE("a stream that stays silent is restarted seldom, and said once") {
  Stalling bench;
  bench.camera->hopeless = true;
  bench.camera->stalls = true;
  CHECK(soon([&] { return bench.camera->opened.load() == 2; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(3000));
  CHECK(bench.camera->opened.load() == 2);
  CHECK(bench.linesWith("no frame for") == 1);
  bench.camera->hopeless = false;
  // Without a restart: its trigger is back.
  bench.camera->stalls = false;
  const std::uint64_t before = bench.sink.count.load();
  CHECK(soon([&] { return bench.sink.count.load() > before + 2; }));
}

TEST_CASE("a camera that returns with another exposure is stamped by it, and its warnings are said") {
  Stalling bench;
  CHECK(bench.sink.shift.load() == 2'500'000);
  bench.camera->exposure = 20'000'000;
  bench.camera->warns = true;
  bench.camera->stalls = true;
  CHECK(soon([&] { return bench.sink.shift.load() == 10'000'000; }));
  CHECK(soon([&] { return bench.linesWith("auto exposure stays on") == 1; }));
  // Again the same: nothing new.
  bench.camera->stalls = true;
  CHECK(soon([&] { return bench.camera->opened.load() == 3; }));
  CHECK(soon([&] { return bench.linesWith("works again") == 2; }));
  CHECK(bench.linesWith("auto exposure stays on") == 1);
}

constexpr Duration kTriggerPeriod = Duration::fromMilliseconds(50);
constexpr int kTriggered = 150;  ///< edges, and frames that they made

Stamp edgeOf(std::uint64_t number) { return {static_cast<std::int64_t>(number + 1) * kTriggerPeriod.ns}; }

/// Each frame is stamped, and arrives, `lag` after its edge.
class TriggeredCamera : public GreyCamera {
 public:
  TriggeredCamera(StampEvent event, Duration given_lag) : lag(given_lag), event_(event) {}
  Duration lag;
  std::optional<Duration> exposure;
  std::atomic<bool> runs{false};

  DeviceFault open() override {
    describe(event_, exposure);
    return {};
  }
  void close() override { forgetLent(); }
  [[nodiscard]] bool isOpen() const override { return true; }
  DeviceFault next(CapturedFrame& frame) override {
    frame.release();
    if (runs.load() && number_ < kTriggered) give(frame, edgeOf(number_) + lag);
    return {};
  }

 private:
  StampEvent event_;
};

class TriggerSink : public SensorSink {
 public:
  void takeImu(const ImuSample& /*sample*/, Stamp /*arrival*/, const HostTimes& /*host*/) override {}
  void takeScene(const SceneImages& /*scene*/) override {}
  void takeImage(const CameraFrame& image, const HostTimes& /*host*/) override {
    if (image.stamp > image.arrival) ++of_future;
    shift = (image.stamp - image.arrival).ns;
    // Of the first 45 some pass before the flight, and 32 before the first match.
    if (image.sequence > 45) {
      const Duration step = image.stamp - newest;
      largest_jump = std::max(largest_jump, std::abs(step.ns - kTriggerPeriod.ns));
    }
    newest = image.stamp;
    last.store(image.sequence);
  }
  int of_future = 0;
  std::int64_t shift = 0;         ///< of the newest: from its arrival to its stamp [ns]
  std::int64_t largest_jump = 0;  ///< ns
  Stamp newest;
  std::atomic<std::uint64_t> last{0};
};

struct Triggered {
  std::string warning;
  std::uint64_t by_trigger = 0;
  LockState lock = LockState::kUnlocked;
  bool off_trigger = false;
  std::int64_t shift = 0;
  std::int64_t largest_jump = 0;
  std::vector<std::string> lines;
};

Triggered fly(std::unique_ptr<TriggeredCamera> owned, const CamerasGroup& settings,
              std::uint64_t edges = kTriggered) {
  TriggeredCamera& camera = *owned;
  CameraThread thread({"camera 0", 0, settings, TriggerGroup{"gpiochip0"}}, std::move(owned));
  REQUIRE(thread.open().ok());
  for (std::uint64_t i = 0; i < edges; ++i) {
    REQUIRE(thread.edges().tryPush({edgeOf(i), i}));
  }
  std::atomic<bool> stop{false};
  RunControl control;
  control.stop = &stop;
  TriggerSink sink;
  camera.runs = true;
  std::thread runner([&] { thread.run(sink, control); });
  CHECK(soon([&] { return sink.last.load() == kTriggered - 1; }));
  stop.store(true);
  runner.join();
  Triggered result;
  result.shift = sink.shift;
  result.largest_jump = sink.largest_jump;
  DeviceEvent event;
  while (thread.journal().next(event)) {
    const std::string line = thread.journal().text(event);
    if (line.find("trigger") != std::string::npos) result.lines.push_back(line);
  }
  CHECK(sink.of_future == 0);
  result.warning = thread.triggerWarning();
  result.by_trigger = thread.status().by_trigger;
  result.lock = thread.status().trigger.lock;
  result.off_trigger = thread.status().off_trigger;
  return result;
}

TEST_CASE("edges are matched to frames only where the delay to the stamps is known") {
  const Duration exposure = Duration::fromMilliseconds(5);
  const Duration readout = Duration::fromMilliseconds(35);
  CamerasGroup settings;
  settings.rate_hz = 20;
  const auto camera = [&](StampEvent event) {
    const bool start = event == StampEvent::kStartOfExposure;
    auto made = std::make_unique<TriggeredCamera>(event, start ? Duration{} : exposure + readout);
    made->exposure = exposure;
    return made;
  };
  SECTION("start of exposure") {
    const Triggered found = fly(camera(StampEvent::kStartOfExposure), settings);
    CHECK(found.warning.empty());
    CHECK(found.by_trigger > 50);
    CHECK(found.lock == LockState::kLocked);
    CHECK_FALSE(found.off_trigger);
  }
  SECTION("the edges end: stamps keep their place, and it is said") {
    auto made = camera(StampEvent::kStartOfExposure);
    made->lag = Duration::fromMilliseconds(8);
    const Triggered found = fly(std::move(made), settings, 80);
    CHECK(found.by_trigger > 30);
    CHECK(found.largest_jump < 100'000);
    CHECK(found.off_trigger);
    REQUIRE(found.lines.size() == 1);
    CHECK_THAT(found.lines[0], Catch::Contains("match no trigger edges") && Catch::Contains("usual delay"));
  }
  SECTION("no edges at all are said") {
    const Triggered found = fly(camera(StampEvent::kStartOfExposure), settings, 0);
    CHECK(found.by_trigger == 0);
    CHECK(found.off_trigger);
    REQUIRE(found.lines.size() == 1);
    CHECK_THAT(found.lines[0], Catch::Contains("match no trigger edges") && Catch::Contains("by the driver"));
  }
  SECTION("end of exposure") {
    auto made = camera(StampEvent::kEndOfExposure);
    made->lag = exposure;
    settings.exposure_ms = 5;
    const Triggered found = fly(std::move(made), settings);
    CHECK(found.warning.empty());
    CHECK(found.by_trigger > 50);
    CHECK(found.shift == -2'500'000);
  }
  SECTION("arrival, which cannot be matched, is after the end of the frame") {
    settings.exposure_ms = 5;
    const Triggered found = fly(camera(StampEvent::kArrival), settings);
    CHECK(found.shift == -2'500'000);
  }
  SECTION("arrival") {
    const Triggered found = fly(camera(StampEvent::kArrival), settings);
    CHECK_THAT(found.warning, Catch::Contains("arrival"));
    CHECK(found.by_trigger == 0);
    CHECK_FALSE(found.off_trigger);
    CHECK(found.lock == LockState::kUnlocked);
  }
  SECTION("end of the frame, exposure and readout unknown") {
    const Triggered found = fly(camera(StampEvent::kEndOfFrame), settings);
    CHECK_THAT(found.warning,
               Catch::Contains("cameras.exposure_ms") && Catch::Contains("cameras.readout_ms"));
    CHECK(found.by_trigger == 0);
    CHECK(found.lock == LockState::kUnlocked);
  }
  SECTION("end of the frame, both known") {
    settings.exposure_ms = 5;
    settings.readout_ms = 35;
    const Triggered found = fly(camera(StampEvent::kEndOfFrame), settings);
    CHECK(found.warning.empty());
    CHECK(found.by_trigger > 50);
    CHECK(found.lock == LockState::kLocked);
  }
}

}  // namespace
}  // namespace swiftlet
