// The IMU's thread on the kernel's own pseudo-terminals, with every serial protocol.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <thread>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/serial/imu_encoder.hpp"
#include "drivers/serial/pseudo_terminal.hpp"
#include "estimator/core/random.hpp"
#include "firmware_host/inputs/devices/port_imu_link.hpp"
#include "tests/firmware_host/live/imu_bench.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet::test {
namespace {

constexpr Duration kReadingPeriod = Duration::fromMilliseconds(2);
constexpr Duration kUptime = Duration::fromMilliseconds(-1'000'000);  ///< device - host

/// A reading's rate about z tells its number, exactly in f32.
constexpr double kNumberStep = 1.0 / 1024;
std::size_t numberOf(const ImuSample& sample) {
  return static_cast<std::size_t>(std::lround(sample.gyro.z() / kNumberStep));
}

/// A sensor at the far end of a port whose name stays.
class FarSensor {
 public:
  explicit FarSensor(ImuProtocol protocol) : encoder_(protocol), protocol_(name(protocol)) { plugIn(); }

  void plugIn() {
    REQUIRE(terminal_.open().ok());
    std::filesystem::remove(port());
    std::filesystem::create_symlink(terminal_.path(), port());
  }
  void unplug() {
    std::filesystem::remove(port());
    terminal_.hangUp();
  }
  [[nodiscard]] std::string port() const { return folder_.file("imu"); }
  [[nodiscard]] std::unique_ptr<ImuLink> link() const {
    ImuLinkGroup settings;
    settings.device = port();
    settings.protocol = protocol_;
    return std::make_unique<PortImuLink>(settings);
  }

  /// Readings at the sensor's rate, sensed when they are sent.
  void send(int count) {
    for (int i = 0; i < count; ++i) {
      sendOne(monotonicNow() + offset);
      std::this_thread::sleep_for(std::chrono::nanoseconds(kReadingPeriod.ns));
    }
  }
  void sendOne(Stamp device) {
    ImuReading reading;
    reading.device = device;
    sensed.push_back(device - offset);
    reading.counter = number_++;
    reading.gyro = {0.5, -0.25, static_cast<double>(number_ - 1) * kNumberStep};
    reading.accel = {1, 2, 9.5};
    std::array<std::uint8_t, ImuEncoder::kLongestFrame> frame;
    sendBytes(std::span(frame).first(encoder_.encode(reading, frame)));
  }
  /// Waits for room: a pseudo-terminal holds 8 kB, and a machine may keep its reader from running for longer
  /// than that.
  void sendBytes(std::span<const std::uint8_t> bytes) {
    REQUIRE(soon([&] {
      std::size_t taken = 0;
      CHECK(terminal_.send(bytes, taken).ok());
      bytes = bytes.subspan(taken);
      return bytes.empty();
    }));
  }

  Duration offset = Duration{} - kUptime;  ///< of its clock to the host's
  std::vector<Stamp> sensed;               ///< of every reading that was sent

 private:
  ScratchFolder folder_{"far_sensor"};
  PseudoTerminal terminal_;
  ImuEncoder encoder_;
  std::string protocol_;
  std::uint64_t number_ = 0;
};

/// A quarter turn about z.
Eigen::Matrix3d quarterTurn() {
  Eigen::Matrix3d R;
  R << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  return R;
}

ImuThread threadOf(const FarSensor& sensor, const Eigen::Matrix3d& R = Eigen::Matrix3d::Identity(),
                   Duration delay = {}) {
  return {"IMU (port)", sensor.link(), ImuCorrection{}.turned(R), delay};
}

bool rising(const KeepingSink& sink) {
  for (std::size_t i = 1; i < sink.count(); ++i) {
    if (sink[i].sample.stamp <= sink[i - 1].sample.stamp) return false;
  }
  return true;
}

/// A sensor's readings, taken up by a thread that has ended.
struct Flown {
  FarSensor sensor;
  KeepingSink sink;
  ImuThread imu;
  std::size_t lines = 0;  ///< about the IMU

  Flown(ImuProtocol protocol, const Eigen::Matrix3d& R, Duration delay, std::size_t readings)
      : sensor(protocol), imu(threadOf(sensor, R, delay)) {
    REQUIRE(imu.open().ok());
    RunningImu running(imu, sink);
    REQUIRE(soon([&] {
      sensor.send(1);
      return sink.count() >= readings;
    }));
    running.end();
    lines = running.linesWith("IMU");
  }
  /// The longest that the machine kept a reading.
  [[nodiscard]] Duration heldUp() const {
    Duration longest;
    for (std::size_t i = 0; i < sink.count(); ++i) {
      const std::size_t number = numberOf(sink[i].sample);
      REQUIRE(number < sensor.sensed.size());
      longest = std::max(longest, sink[i].arrival - sensor.sensed[number]);
    }
    return longest;
  }
  /// That sample i may be stamped: `arrived`, but where readings came together, and stamps have to rise, a
  /// quarter of the sensor's own step behind the one before (rising_stamps.hpp).
  [[nodiscard]] Stamp latest(std::size_t i, Stamp arrived) const {
    constexpr Duration kTick = Duration{100'000};  // of the coarsest clock, Xsens'
    if (i == 0) return arrived;
    const std::size_t number = numberOf(sink[i].sample);
    const Duration step = sensor.sensed[number] - sensor.sensed[number - 1];
    return std::max(arrived, sink[i - 1].sample.stamp + Duration{(step + kTick).ns / 4});
  }
};

/// By a machine that runs: a clock that begins with readings which it kept is not known to a millisecond.
std::unique_ptr<Flown> fly(ImuProtocol protocol, const Eigen::Matrix3d& R, Duration delay,
                           std::size_t readings) {
  constexpr Duration kHeldUp = Duration::fromMilliseconds(10);
  for (int i = 0; i < 20; ++i) {
    auto flown = std::make_unique<Flown>(protocol, R, delay, readings);
    if (flown->heldUp() < kHeldUp) return flown;
  }
  FAIL("the machine stood still in every flight");
  return nullptr;
}

TEST_CASE("samples of every protocol come stamped near the truth and in the body's axes") {
  for (const ImuProtocol protocol : {ImuProtocol::kVectorNav, ImuProtocol::kXsens, ImuProtocol::kMip,
                                     ImuProtocol::kMavlink, ImuProtocol::kBridge}) {
    INFO(name(protocol));
    const auto flown = fly(protocol, quarterTurn(), {}, 100);
    const KeepingSink& sink = flown->sink;
    CHECK(rising(sink));
    std::vector<std::int64_t> errors;
    for (std::size_t i = 0; i < sink.count(); ++i) {
      const KeepingSink::Kept& kept = sink[i];
      const std::size_t number = numberOf(kept.sample);
      if (i > 0) CHECK(number == numberOf(sink[i - 1].sample) + 1);
      CHECK(kept.sample.stamp <= flown->latest(i, kept.arrival));
      errors.push_back((kept.sample.stamp - flown->sensor.sensed[number]).ns);
      CHECK((kept.sample.gyro.head<2>() - Eigen::Vector2d(0.25, 0.5)).norm() < 1e-6);
      CHECK((kept.sample.accel - Eigen::Vector3d(-2, 1, 9.5)).norm() < 1e-5);
    }
    std::ranges::sort(errors);
    CHECK(errors.front() > -1'000'000);  // Xsens counts tenths of a millisecond
    CHECK(errors[errors.size() / 2] < 2'000'000);
    const ImuStatus status = flown->imu.status();
    CHECK(status.samples == sink.count());
    CHECK(status.by_arrival == 0);
    CHECK(status.refused == 0);
    CHECK(flown->lines == 0);
  }
}

TEST_CASE("the constant delay is taken off every stamp") {
  constexpr Duration kDelay = Duration::fromMilliseconds(40);
  const auto flown = fly(ImuProtocol::kBridge, Eigen::Matrix3d::Identity(), kDelay, 20);
  const KeepingSink& sink = flown->sink;
  for (std::size_t i = 0; i < sink.count(); ++i) {
    CHECK(sink[i].sample.stamp <= flown->latest(i, sink[i].arrival - kDelay));
  }
}

TEST_CASE("what waited before the flight has no share in it") {
  FarSensor sensor(ImuProtocol::kBridge);
  KeepingSink sink;
  ImuThread imu = threadOf(sensor);
  REQUIRE(imu.open().ok());
  sensor.send(20);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  RunningImu running(imu, sink);
  REQUIRE(soon([&] {
    sensor.send(1);
    return sink.count() > 30;
  }));
  running.end();
  CHECK(numberOf(sink[0].sample) >= 20);
}

TEST_CASE("a sensor that is unplugged is told gone once, and taken up when it returns") {
  FarSensor sensor(ImuProtocol::kBridge);
  KeepingSink sink;
  ImuThread imu = threadOf(sensor);
  REQUIRE(imu.open().ok());
  RunningImu running(imu, sink);
  REQUIRE(soon([&] {
    sensor.send(1);
    return sink.count() > 10;
  }));
  sensor.unplug();
  REQUIRE(soon([&] { return running.linesWith("gone") > 0; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(450));  // two more looks for it
  CHECK(running.linesWith("gone") == 1);
  CHECK(running.linesWith("connect it again: it is reopened automatically") == 1);
  CHECK(running.linesWith("not there") == 0);
  CHECK(running.linesWith("works again") == 0);

  sensor.offset =
      Duration::fromMilliseconds(77) - Duration{monotonicNow().ns};  // it was switched off meanwhile
  const Stamp back = monotonicNow();
  sensor.plugIn();
  const std::size_t before = sink.count();
  REQUIRE(soon([&] {
    sensor.send(1);
    return sink.count() > before + 50;
  }));
  CHECK(running.linesWith("works again") == 1);
  running.end();
  CHECK(rising(sink));
  CHECK(sink[before].sample.stamp > back);
  for (std::size_t i = before; i < sink.count(); ++i) CHECK(sink[i].sample.stamp <= sink[i].arrival);
}

TEST_CASE("silence is told once, and its end once") {
  FarSensor sensor(ImuProtocol::kBridge);
  KeepingSink sink;
  ImuThread imu = threadOf(sensor);
  REQUIRE(imu.open().ok());
  RunningImu running(imu, sink);
  REQUIRE(soon([&] {
    sensor.send(1);
    return sink.count() > 10;
  }));
  REQUIRE(soon([&] { return running.linesWith("sends nothing (no data for 1.") > 0; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(250));
  CHECK(running.linesWith("sends nothing") == 1);
  CHECK(running.linesWith("works again") == 0);
  const std::size_t before = sink.count();
  REQUIRE(soon([&] {
    sensor.send(1);
    return sink.count() > before + 10;
  }));
  CHECK(running.linesWith("works again") == 1);
  CHECK(running.linesWith("sends nothing") == 1);
}

TEST_CASE("garbage is told apart from silence, and readings between it still come") {
  FarSensor sensor(ImuProtocol::kVectorNav);
  KeepingSink sink;
  ImuThread imu = threadOf(sensor);
  REQUIRE(imu.open().ok());
  RunningImu running(imu, sink);
  Random random(7);
  const auto garbage = [&] {
    std::array<std::uint8_t, 64> bytes;
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random.next());
    sensor.sendBytes(bytes);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  };
  REQUIRE(soon([&] {
    garbage();
    return running.linesWith("without an IMU sample") > 0;
  }));
  CHECK(running.linesWith("check the baud rate and the protocol") == 1);
  CHECK(sink.count() == 0);
  REQUIRE(soon([&] {
    garbage();
    sensor.send(10);
    return sink.count() > 20;
  }));
  CHECK(running.linesWith("works again") == 1);
  CHECK(running.linesWith("sends nothing") == 0);
}

TEST_CASE("a clock that steps costs tenths of a second, and no stamp of the future") {
  FarSensor sensor(ImuProtocol::kBridge);
  KeepingSink sink;
  ImuThread imu = threadOf(sensor);
  REQUIRE(imu.open().ok());
  RunningImu running(imu, sink);
  REQUIRE(soon([&] {
    sensor.send(1);
    return sink.count() > 50;
  }));
  for (const std::int64_t step_ms : {500LL, -7'000LL, 3'600'000LL}) {
    INFO("step of " << step_ms << " ms");
    sensor.offset = sensor.offset + Duration::fromMilliseconds(step_ms);
    const std::size_t before = sink.count();
    const Stamp begin = monotonicNow();
    REQUIRE(soon([&] {
      sensor.send(1);
      return sink.count() > before + 50;
    }));
    CHECK(monotonicNow() - begin < Duration::fromMilliseconds(3000));
    for (std::size_t i = before; i < sink.count(); ++i) {
      CHECK(sink[i].sample.stamp <= sink[i].arrival);
      CHECK(sink[i].arrival - sink[i].sample.stamp < Duration::fromMilliseconds(1000));
    }
  }
  running.end();
  CHECK(rising(sink));
  CHECK(imu.status().clock.resets >= 3);
}

TEST_CASE("a clock that stands still is told: its samples are all refused") {
  FarSensor sensor(ImuProtocol::kBridge);
  KeepingSink sink;
  ImuThread imu = threadOf(sensor);
  REQUIRE(imu.open().ok());
  RunningImu running(imu, sink);
  const Stamp still = monotonicNow() + sensor.offset;
  REQUIRE(soon([&] {
    sensor.sendOne(still);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    return running.linesWith("clock stands still or goes back") > 0;
  }));
  CHECK(sink.count() <= 1);
}

TEST_CASE("an autopilot's readings come by UDP, and a flood of datagrams is slowed down") {
  ImuLinkGroup settings;
  settings.device = "udp:127.0.0.1:24593@24594";
  settings.protocol = "mavlink";
  PortImuLink link(settings);
  REQUIRE(link.open().ok());
  LinkPort autopilot("udp:127.0.0.1:24594@24593", 0);
  REQUIRE(autopilot.open().ok());
  ImuEncoder encoder(ImuProtocol::kMavlink);
  constexpr int kReadings = 200;
  for (int i = 0; i < kReadings; ++i) {
    ImuReading reading;
    reading.device = Stamp{(i + 1) * 5'000'000};
    reading.gyro = reading.accel = Eigen::Vector3d(0.5, 0.25, 0.125);
    std::array<std::uint8_t, ImuEncoder::kLongestFrame> frame;
    REQUIRE(autopilot.write(std::span(frame).first(encoder.encode(reading, frame))).ok());
  }
  const Stamp begin = monotonicNow();
  int readings = 0;
  REQUIRE(soon([&] {
    for (int i = 0; i < 50; ++i) CHECK(link.receive(monotonicNow()).ok());
    for (ImuReading reading; link.next(reading);) ++readings;
    return readings == kReadings;
  }));
  CHECK(monotonicNow() - begin >= Duration::fromMilliseconds(kReadings / 64));
}

}  // namespace
}  // namespace swiftlet::test
