// What the thread says when the estimate, or the port, is not as it should be.

#include <catch2/catch.hpp>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "drivers/serial/pseudo_terminal.hpp"
#include "tests/firmware_host/autopilot/scripted_vehicle.hpp"

namespace swiftlet::test {
namespace {

constexpr std::uint8_t kActive = 4;
constexpr std::uint8_t kCritical = 5;

/// A port, and the autopilot that listens at its other end.
struct Plug {
  PseudoTerminal terminal;
  Heard heard;

  Plug() { REQUIRE(terminal.open().ok()); }
  void listen() {
    std::array<std::uint8_t, 4096> bytes;
    std::size_t count = 0;
    while (terminal.receive(bytes, count).ok() && count > 0) heard.take(std::span(bytes).first(count));
  }
};

TEST_CASE("Degraded, failed and good again are told as autopilots understand them", "[autopilot]") {
  Plug plug;
  Vehicle vehicle;
  AutopilotThread autopilot(vehicle.outlet, optionsOf(plug.terminal.path()));
  const auto fly = [&](Health health, double seconds) {
    vehicle.tellHealth(health);
    const std::size_t from = plug.heard.poses.size();
    pass(seconds, [&] {
      vehicle.move(health);
      plug.listen();
    });
    return std::span(plug.heard.poses).subspan(from);
  };
  // The first of a new health may still be of the one before.
  const auto good = fly(Health::kGood, 0.4);
  REQUIRE(good.size() > 4);
  CHECK(good.back().quality == 100);
  const auto degraded = fly(Health::kDegraded, 0.4);
  REQUIRE(degraded.size() > 4);
  for (const auto& pose : degraded.subspan(1)) CHECK((pose.quality > 0 && pose.quality < 100));
  CHECK(degraded.back().reset_counter == 0);

  const auto failed = fly(Health::kFailed, 1.8);
  REQUIRE(failed.size() > 10);
  CHECK(failed.size() <= 43);  // a second of it, then silence
  for (const auto& pose : failed.subspan(1)) {
    CHECK(pose.quality == -1);
    CHECK(std::isnan(pose.position.x()));
  }
  CHECK(plug.heard.heartbeats.back().system_status == kCritical);
  const auto again = fly(Health::kGood, 1.2);
  REQUIRE(again.size() > 10);
  for (const auto& pose : again.subspan(1)) {
    CHECK(pose.quality == 100);
    CHECK(pose.reset_counter == 1);
  }
  CHECK(plug.heard.heartbeats.back().system_status == kActive);
  const std::vector<std::string> wanted = {"swiftlet: good", "swiftlet: degraded", "swiftlet: failed",
                                           "swiftlet: good"};
  CHECK(plug.heard.texts == wanted);
}

TEST_CASE("Reasons that stand are said again after the period, readiness once", "[autopilot]") {
  Plug plug;
  Vehicle vehicle;
  AutopilotThreadOptions options = optionsOf(plug.terminal.path());
  options.repeat = Duration::fromMilliseconds(300);
  vehicle.say("no images");
  AutopilotThread autopilot(vehicle.outlet, options);
  pass(1, [&] { plug.listen(); });
  // At 0, 300, 600 and 900 ms; a busy machine may be late.
  const auto said = static_cast<int>(plug.heard.texts.size());
  CHECK(said >= 2);
  CHECK(said <= 4);
  for (const std::string& text : plug.heard.texts) CHECK(text == "not ready: sensors: no images");
  vehicle.say("");
  pass(0.8, [&] { plug.listen(); });
  CHECK(std::ranges::count(plug.heard.texts, "swiftlet: ready to arm") == 1);
  CHECK(static_cast<int>(plug.heard.texts.size()) <= said + 2);
}

TEST_CASE("A mesh that stands is told at the rate while it is fresh, from where the vehicle is by now",
          "[autopilot]") {
  Plug plug;
  Vehicle vehicle;
  AutopilotThread autopilot(vehicle.outlet, optionsOf(plug.terminal.path()));
  LocalMesh& mesh = vehicle.outlet.mesh.draft();
  mesh = {};
  mesh.stamp = monotonicNow();
  for (const Eigen::Vector3f& p : {Eigen::Vector3f(9, -1, -1), {9, 1, -1}, {9, 0, 1}}) {
    static_cast<void>(mesh.vertices.tryPushBack({0, p, 0}));
  }
  static_cast<void>(mesh.faces.tryPushBack({{0, 1, 2}, kNoLabel}));
  vehicle.outlet.mesh.publish();
  pass(1.2, [&] {
    vehicle.move();
    plug.listen();
  });
  const auto& told = plug.heard.obstacles;
  REQUIRE(told.size() >= 3);
  CHECK(told.size() <= 6);  // half a second of it
  for (std::size_t i = 1; i < told.size(); ++i) {
    CHECK(told[i].time_usec == told[0].time_usec);
    CHECK(told[i].distance_cm[0] < told[i - 1].distance_cm[0]);
  }
}

TEST_CASE("A port that takes nothing loses what is sent, counted and noted, and keeps nobody",
          "[autopilot]") {
  Plug plug;
  Vehicle vehicle;
  AutopilotThreadOptions options = optionsOf(plug.terminal.path());
  options.settings.rate_hz = 200;
  AutopilotThread autopilot(vehicle.outlet, options);
  std::vector<std::string> lines;
  const auto drain = [&] {
    autopilot.drainEvents([&](Stamp, const std::string& line) { lines.push_back(line); });
  };
  // Nobody reads: the kernel's buffer fills.
  for (int i = 0; i < 20 && lines.empty(); ++i) {
    pass(0.2, [&] {
      vehicle.move();
      drain();
    });
  }
  REQUIRE(lines.size() == 1);
  CHECK(lines[0].find("autopilot (" + plug.terminal.path() + ")") == 0);
  CHECK(lines[0].find("not taken") != std::string::npos);
  CHECK(lines[0].find("autopilot.baud") != std::string::npos);
  // Then it is read again: the newest comes through whole.
  pass(0.5, [&] {
    vehicle.move();
    plug.listen();
    drain();
  });
  const Stamp now = monotonicNow();
  REQUIRE_FALSE(plug.heard.poses.empty());
  const mavlink::Odometry& newest = plug.heard.poses.back();
  CHECK(newest.quality == 100);
  const double age = (now - Stamp{}).seconds() - static_cast<double>(newest.time_usec) * 1e-6;
  CHECK(age < 0.3);
  const nlohmann::ordered_json counted = autopilot.finish();
  CHECK(counted["writes_refused"].get<int>() > 0);
  CHECK(counted["faults"] == 0);
  CHECK(lines.size() == 1);
}

}  // namespace
}  // namespace swiftlet::test
