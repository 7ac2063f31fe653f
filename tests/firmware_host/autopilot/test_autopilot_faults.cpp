// What the thread says when the estimate, or the port, is not as it should be.

#include <algorithm>
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
  MavlinkSender sender;

  Plug() { REQUIRE(terminal.open().ok()); }
  void listen() {
    std::array<std::uint8_t, 4096> bytes;
    std::size_t count = 0;
    while (terminal.receive(bytes, count).ok() && count > 0) heard.take(std::span(bytes).first(count));
  }
  /// Says that the autopilot lives.
  void beat() {
    std::array<std::uint8_t, kLongestMavlinkFrame> frame;
    mavlink::Heartbeat px4;
    px4.autopilot = mavlink::Heartbeat::kPx4;
    const std::size_t length = mavlink::write(sender, px4, frame);
    std::size_t taken = 0;
    REQUIRE(terminal.send(std::span(frame).first(length), taken).ok());
  }
};

TEST_CASE("Degraded, failed and good again are told as autopilots understand them", "[autopilot]") {
  Plug plug;
  Vehicle vehicle;
  AutopilotThread autopilot(vehicle.outlet, optionsOf(plug.terminal.path()));
  using Pose = mavlink::Odometry;
  const std::vector<Pose>& poses = plug.heard.poses;
  // Until five poses, two heartbeats and a text of it came; gives what came of it.
  const auto fly = [&](Health health, auto&& is_of_it) {
    vehicle.tellHealth(health);
    const std::size_t texts = plug.heard.texts.size(), beats = plug.heard.heartbeats.size() + 2;
    const auto from = static_cast<std::uint64_t>(monotonicNow().ns / 1000 + 1);
    const auto since = [&] {
      return std::span(std::ranges::lower_bound(poses, from, {}, &Pose::time_usec), poses.end());
    };
    const auto enough = [&] {
      return std::ranges::count_if(since(), is_of_it) >= 5 && plug.heard.texts.size() > texts &&
             plug.heard.heartbeats.size() >= beats;
    };
    REQUIRE(until(enough, [&] {
      vehicle.move(health);
      plug.listen();
    }));
    return since();
  };
  const auto isGood = [](const Pose& pose) { return pose.quality == 100; };
  const auto isDegraded = [](const Pose& pose) { return pose.quality > 0 && pose.quality < 100; };
  const auto isLost = [](const Pose& pose) { return pose.quality == -1 && std::isnan(pose.position.x()); };
  plug.beat();
  static_cast<void>(fly(Health::kGood, isGood));
  for (const Pose& pose : fly(Health::kDegraded, isDegraded)) CHECK_FALSE(isGood(pose));
  const int resets = poses.back().reset_counter;

  const auto lost = fly(Health::kFailed, isLost);
  CHECK(std::ranges::all_of(lost, isLost));
  CHECK(plug.heard.heartbeats.back().system_status == kCritical);
  const std::size_t before = poses.size() - lost.size();
  const auto fail = [&] {
    vehicle.move(Health::kFailed);
    plug.listen();
  };
  // A second of it, then silence.
  pass(0.5, fail);
  const std::size_t told = poses.size();
  CHECK(told - before <= 43);
  pass(0.3, fail);
  CHECK(poses.size() == told);

  const auto again = fly(Health::kGood, isGood);
  CHECK(again.back().reset_counter == static_cast<std::uint8_t>(resets + 1));
  CHECK(plug.heard.heartbeats.back().system_status == kActive);
  const std::vector<std::string> wanted = {"swiftlet: good", "swiftlet: degraded", "swiftlet: failed",
                                           "swiftlet: good"};
  CHECK(plug.heard.texts == wanted);
}

TEST_CASE("Who is late or lost, that states stop, and that the supervisor does, is told in words",
          "[autopilot]") {
  Plug plug;
  Vehicle vehicle;
  AutopilotThread autopilot(vehicle.outlet, optionsOf(plug.terminal.path()));
  const auto said = [&](const char* text) { return std::ranges::count(plug.heard.texts, text) > 0; };
  const auto fly = [&] {
    vehicle.move();
    plug.listen();
  };
  const auto untilSaid = [&](const char* text, auto&& each) {
    INFO(text);
    const Stamp begin = monotonicNow();
    CHECK(until([&] { return said(text); }, each));
    return (monotonicNow() - begin).seconds();
  };
  vehicle.tellHealth(Health::kGood);
  untilSaid("swiftlet: good", fly);
  vehicle.verdict.health = Health::kDegraded;
  vehicle.tellTrouble("mesh", Condition::kLost, "no memory");
  untilSaid("swiftlet: mesh is lost: no memory", fly);
  untilSaid("swiftlet: degraded", fly);
  // The state calls itself good; what is said of it is the verdict.
  const std::size_t poses = plug.heard.poses.size();
  REQUIRE(until([&] { return plug.heard.poses.size() > poses + 5; }, fly));
  CHECK(plug.heard.poses.back().quality == 40);
  vehicle.tellTrouble("", Condition::kOk, "");
  vehicle.tellHealth(Health::kGood);
  untilSaid("swiftlet: mesh has recovered", fly);

  const auto stand = [&] {
    vehicle.supervise();
    plug.listen();
  };
  untilSaid("swiftlet: no new state for 0.3 s", stand);
  untilSaid("swiftlet: states are arriving again", fly);

  const auto unsupervised = [&] {
    vehicle.moveUnsupervised();
    plug.listen();
  };
  untilSaid("swiftlet: supervisor stopped, health unknown", unsupervised);
  const std::size_t since = plug.heard.poses.size();
  REQUIRE(until([&] { return plug.heard.poses.size() > since + 5; }, unsupervised));
  CHECK(plug.heard.poses.back().quality == 40);
  untilSaid("swiftlet: supervisor is running again", fly);

  // The end of a run is none of these.
  vehicle.verdict.ending = true;
  fly();
  const std::size_t texts = plug.heard.texts.size();
  pass(0.8, [&] { plug.listen(); });
  CHECK(plug.heard.texts.size() == texts);
}

TEST_CASE("Poses are degraded until a supervisor has judged them", "[autopilot]") {
  Plug plug;
  Vehicle vehicle;
  AutopilotThread autopilot(vehicle.outlet, optionsOf(plug.terminal.path()));
  const auto& poses = plug.heard.poses;
  REQUIRE(until([&] { return poses.size() > 5; },
                [&] {
                  vehicle.moveUnsupervised();
                  plug.listen();
                }));
  for (const mavlink::Odometry& pose : poses) CHECK(pose.quality == 40);
  CHECK(plug.heard.texts.empty());
  vehicle.tellHealth(Health::kGood);
  REQUIRE(until([&] { return poses.back().quality == 100; },
                [&] {
                  vehicle.move();
                  plug.listen();
                }));
}

TEST_CASE("Reasons that stand are said again after the period, readiness once", "[autopilot]") {
  Plug plug;
  Vehicle vehicle;
  AutopilotThreadOptions options = optionsOf(plug.terminal.path());
  options.repeat = Duration::fromMilliseconds(300);
  vehicle.say("no images");
  const Stamp begin = monotonicNow();
  AutopilotThread autopilot(vehicle.outlet, options);
  const auto listen = [&] {
    vehicle.supervise();
    plug.listen();
  };
  REQUIRE(until([&] { return plug.heard.texts.size() >= 3; }, listen));
  const std::size_t said = plug.heard.texts.size();
  CHECK(said <= mostSince(begin, 1 / options.repeat.seconds()));
  CHECK(monotonicNow() - begin >= options.repeat + options.repeat);
  for (const std::string& text : plug.heard.texts) CHECK(text == "not ready: sensors: no images");
  vehicle.say("");
  REQUIRE(until([&] { return plug.heard.texts.back() == "swiftlet: ready to arm"; }, listen));
  pass(0.7, listen);
  CHECK(plug.heard.texts.back() == "swiftlet: ready to arm");
  CHECK(std::ranges::count(plug.heard.texts, "swiftlet: ready to arm") == 1);
}

TEST_CASE("A mesh that stands is told at the rate while it is fresh, from where the vehicle is by now",
          "[autopilot]") {
  Plug plug;
  Vehicle vehicle;
  AutopilotThread autopilot(vehicle.outlet, optionsOf(plug.terminal.path()));
  const auto& told = plug.heard.obstacles;
  const auto fly = [&] {
    vehicle.move();
    plug.listen();
  };
  // Where the machine stands still while a mesh is fresh, the next mesh is looked at.
  std::size_t first = 0;
  for (int i = 0; i < 20 && told.size() < first + 3; ++i) {
    first = told.size();
    LocalMesh& mesh = vehicle.outlet.mesh.draft();
    mesh = {};
    mesh.stamp = monotonicNow();
    const auto wall = static_cast<float>((mesh.stamp - vehicle.begin).seconds() + 9);
    for (const Eigen::Vector3f& p : {Eigen::Vector3f(wall, -1, -1), {wall, 1, -1}, {wall, 0, 1}}) {
      static_cast<void>(mesh.vertices.tryPushBack({0, p, 0}));
    }
    static_cast<void>(mesh.faces.tryPushBack({{0, 1, 2}, kNoLabel}));
    vehicle.outlet.mesh.publish();
    pass(1.2, fly);
  }
  REQUIRE(told.size() >= first + 3);
  CHECK(told.size() <= first + 6);  // half a second of it
  for (std::size_t i = first + 1; i < told.size(); ++i) {
    CHECK(told[i].time_usec == told[first].time_usec);
    CHECK(told[i].distance_cm[0] < told[i - 1].distance_cm[0]);
  }
}

TEST_CASE("Obstacles end where the supervisor knows of a failure that the estimator does not see",
          "[autopilot]") {
  Plug plug;
  Vehicle vehicle;
  AutopilotThread autopilot(vehicle.outlet, optionsOf(plug.terminal.path()));
  const auto fly = [&] {
    vehicle.move();
    vehicle.showWall();
    plug.listen();
  };
  vehicle.tellHealth(Health::kGood);
  REQUIRE(until([&] { return plug.heard.obstacles.size() > 2; }, fly));
  vehicle.tellHealth(Health::kFailed);
  REQUIRE(until([&] { return std::ranges::count(plug.heard.texts, "swiftlet: failed") > 0; }, fly));
  const std::size_t before = plug.heard.obstacles.size();
  pass(0.5, fly);
  CHECK(plug.heard.obstacles.size() == before);
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
  // It beats all the while: silence would be another fault.
  const auto fly = [&] {
    vehicle.move();
    plug.beat();
    drain();
  };
  // Nobody reads: the kernel's buffer fills.
  REQUIRE(until([&] { return !lines.empty(); }, fly));
  CHECK(lines[0].find("autopilot (" + plug.terminal.path() + ")") == 0);
  CHECK(lines[0].find("writes rejected") != std::string::npos);
  CHECK(lines[0].find("autopilot.baud") != std::string::npos);
  // Then it is read again: the newest comes through whole.
  const Stamp read_again = monotonicNow();
  const auto isNew = [&](const mavlink::Odometry& pose) {
    return pose.quality == 100 && static_cast<std::int64_t>(pose.time_usec) > read_again.ns / 1000;
  };
  REQUIRE(until([&] { return std::ranges::any_of(plug.heard.poses, isNew); },
                [&] {
                  fly();
                  plug.listen();
                }));
  const nlohmann::ordered_json counted = autopilot.finish();
  CHECK(counted["writes_refused"].get<int>() > 0);
  CHECK(counted["faults"] == 0);
  CHECK(lines.size() == 1);
}

}  // namespace
}  // namespace swiftlet::test
