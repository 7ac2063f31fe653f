// The autopilot's thread, the supervisor's, and the IMU's on a link that both use allocate nothing and take
// no lock once they run: seen from underneath the program and its libraries.

#include <atomic>
#include <catch2/catch.hpp>
#include <cstdint>
#include <memory>
#include <thread>

#include "drivers/serial/pseudo_terminal.hpp"
#include "firmware_host/inputs/devices/imu_thread.hpp"
#include "firmware_host/inputs/devices/port_imu_link.hpp"
#include "firmware_host/interfaces/link_port.hpp"
#include "firmware_host/supervisor/supervisor.hpp"
#include "tests/firmware_host/autopilot/far_autopilot.hpp"
#include "tests/firmware_host/autopilot/scripted_vehicle.hpp"
#include "tests/logs/flight_trap.hpp"

namespace swiftlet::test {
namespace {

TEST_CASE("poses, obstacles, texts and answers cost the autopilot's thread no heap call and no lock",
          "[autopilot]") {
  LinkPort far("udp:127.0.0.1:24592@24591", 0);
  REQUIRE(far.open().ok());
  Vehicle vehicle;
  Heard heard;
  std::atomic<int> turns{0};
  auto options = optionsOf("udp:127.0.0.1:24591@24592");
  options.repeat = Duration::fromMilliseconds(100);
  // The thread asks at each turn until it is answered: its own place to arm the trap.
  options.to_host = [&]() -> std::optional<Duration> {
    if (++turns < 3) return std::nullopt;
    armTrap("autopilot");
    return Duration{};
  };
  const TrapCounts before = trapCounts();
  const std::uint64_t all_before = heapCallsOfAll();
  AutopilotThread autopilot(vehicle.outlet, options);
  MavlinkSender sender;
  int step = 0;
  const auto fly = [&] {
    ++step;
    if (step % 8 == 0) vehicle.tellTrouble("mesh", Condition::kLost, "no memory, and a long text about it");
    if (step % 8 == 4) vehicle.tellTrouble("", Condition::kOk, "");
    if (step % 16 == 0) vehicle.say("the IMU delivers at 12.5 Hz, expected are 200.0 Hz within 20 %");
    if (step % 16 == 8) vehicle.say("");
    vehicle.tellHealth(step % 20 < 10 ? Health::kGood : Health::kDegraded);
    LocalMesh& mesh = vehicle.outlet.mesh.draft();
    mesh = {};
    mesh.stamp = monotonicNow();
    for (const Eigen::Vector3f& p : {Eigen::Vector3f(9, -1, -1), {9, 1, -1}, {9, 0, 1}}) {
      static_cast<void>(mesh.vertices.tryPushBack({0, p, 0}));
    }
    static_cast<void>(mesh.faces.tryPushBack({{0, 1, 2}, kNoLabel}));
    vehicle.outlet.mesh.publish();
    if (step % 10 == 0) {
      std::array<std::uint8_t, kLongestMavlinkFrame> request;
      const std::size_t length = mavlink::write(sender, mavlink::Timesync{0, 123'456'789, 0, 0}, request);
      static_cast<void>(far.write(std::span(request).first(length)));
    }
    vehicle.move();
    std::array<std::uint8_t, 2048> bytes;
    std::size_t count = 1;
    for (Stamp at; far.read(bytes, count, at).ok() && count > 0;) heard.take(std::span(bytes).first(count));
  };
  const auto enough = [&] {
    return heard.poses.size() > 40 && heard.obstacles.size() > 8 && heard.answers.size() > 3 &&
           heard.texts.size() > 20;
  };
  REQUIRE(until(enough, fly));
  // States and the supervisor fall silent: texts of the thread's own.
  const std::size_t texts = heard.texts.size();
  const auto listen = [&] {
    std::array<std::uint8_t, 2048> bytes;
    std::size_t count = 1;
    for (Stamp at; far.read(bytes, count, at).ok() && count > 0;) heard.take(std::span(bytes).first(count));
  };
  REQUIRE(until(
      [&] {
        return std::ranges::any_of(heard.texts, [](const std::string& text) {
          return text == "swiftlet: supervisor stopped, health unknown";
        });
      },
      listen));
  CHECK(heard.texts.size() > texts);
  const TrapCounts counts = trapCounts();
  CHECK(heapCallsOfAll() > all_before);  // the trap works: this thread and the test allocate
  CHECK(counts.waits > before.waits);    // and is armed: the port is read
  CHECK(counts.heap == before.heap);
  CHECK(counts.locks == before.locks);
}

TEST_CASE("one link for IMU and poses costs the IMU's thread no heap call and no lock", "[autopilot]") {
  PseudoTerminal terminal;
  REQUIRE(terminal.open().ok());
  struct ArmingSink : SensorSink {
    LiveOutlet* outlet = nullptr;
    std::atomic<int> taken{0};
    void takeImu(const ImuSample& sample, Stamp /*arrival*/, const HostTimes& /*host*/) override {
      if (++taken == 3) armTrap("imu");
      NavState state;
      state.stamp = sample.stamp;
      state.health = Health::kGood;
      outlet->state.write({state, Eigen::Vector3d::Zero()});
    }
    void takeScene(const SceneImages& /*scene*/) override {}
    void takeImage(const CameraFrame& /*image*/, const HostTimes& /*host*/) override {}
  } sink;
  LiveOutlet outlet;
  sink.outlet = &outlet;
  LinkOutbox outbox;
  ImuLinkGroup settings;
  settings.device = terminal.path();
  settings.protocol = "mavlink";
  ImuThread imu("IMU", std::make_unique<PortImuLink>(settings, 200, &outbox), ImuCorrection{}, {}, 200);
  REQUIRE(imu.open().ok());
  auto options = optionsOf(terminal.path());
  options.outbox = &outbox;
  std::atomic<int> turns{0};
  options.to_host = [&]() -> std::optional<Duration> {
    if (++turns < 3) return std::nullopt;
    armTrap("autopilot");
    return Duration{};
  };
  const TrapCounts before = trapCounts();
  AutopilotThread autopilot(outlet, options);
  std::atomic<bool> stop{false};
  RunControl control;
  control.stop = &stop;
  std::thread thread([&] {
    imu.run(sink, {}, control);
    disarmTrap();
  });
  FarAutopilot far(monotonicNow(), {});
  FarAutopilot::Bytes out;
  const auto pump = [&] {
    std::array<std::uint8_t, 512> bytes;
    std::size_t count = 0, taken = 0;
    static_cast<void>(terminal.receive(bytes, count));
    const Stamp now = monotonicNow();
    far.receive(now, std::span(bytes).first(count));
    far.step(
        now, [](Stamp) { return monotonicNow(); },
        [&](const FarAutopilot::Bytes& more, Stamp) { out.insert(out.end(), more.begin(), more.end()); });
    if (!out.empty()) static_cast<void>(terminal.send(out, taken));
    out.erase(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(taken));
  };
  CHECK(until([&] { return far.pose_times.size() > 50 && sink.taken > 300 && far.requests > 0; }, pump));
  stop.store(true);
  thread.join();
  const TrapCounts counts = trapCounts();
  CHECK(counts.waits > before.waits);
  CHECK(counts.heap == before.heap);
  CHECK(counts.locks == before.locks);
}

TEST_CASE("the supervisor's thread makes no heap call and takes no lock", "[supervisor]") {
  Supervisor supervisor;
  Heartbeat mesh, smooth;
  REQUIRE(supervisor.add("mesh", mesh));
  REQUIRE(supervisor.add("smooth", smooth));
  std::atomic<int> looks{0};
  REQUIRE(supervisor.addSink([&](const Verdict&) {
    if (++looks == 2) armTrap("supervisor");
  }));
  FlightGround ground;
  ground.cameras = 2;
  supervisor.begin(ground, [&](FlightFacts& facts) {
    // Troubles that come and go.
    facts.equal_samples = looks % 3 == 0 ? 200 : 0;
  });
  const TrapCounts before = trapCounts();
  ThreadSettings settings;
  settings.name = "supervisor";
  REQUIRE(supervisor.start(settings).started);
  mesh.begin();
  smooth.begin();
  mesh.fail("no memory");
  int events = 0;
  REQUIRE(until([&] { return looks > 15; },
                [&] { supervisor.drainEvents([&](Stamp, const std::string&) { ++events; }); }));
  CHECK(events > 4);
  const TrapCounts counts = trapCounts();
  CHECK(counts.heap == before.heap);
  CHECK(counts.locks == before.locks);
}

}  // namespace
}  // namespace swiftlet::test
