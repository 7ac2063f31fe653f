// The thread beside a scripted run: over a pseudo-terminal that is unplugged and comes back, and over UDP.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "drivers/serial/pseudo_terminal.hpp"
#include "firmware_host/interfaces/link_port.hpp"
#include "tests/firmware_host/autopilot/scripted_vehicle.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet::test {
namespace {

void checkPoses(const Heard& heard, Stamp begin) {
  for (std::size_t i = 0; i < heard.poses.size(); ++i) {
    const mavlink::Odometry& pose = heard.poses[i];
    if (pose.quality < 0) continue;
    // Where the vehicle was at the stamp that the message has.
    const double then = static_cast<double>(pose.time_usec) * 1e-6 - (begin - Stamp{}).seconds();
    REQUIRE(std::abs(pose.position.x() - then) < 1e-4);
    if (i > 0) REQUIRE(pose.time_usec > heard.poses[i - 1].time_usec);
  }
}

TEST_CASE("Over a serial port: poses, reasons, health, clocks; unplugged and back", "[autopilot]") {
  const ScratchFolder folder("autopilot_port");
  const std::filesystem::path port = folder.file("by-id");
  PseudoTerminal plug;
  Heard heard;
  const auto plugIn = [&] {
    REQUIRE(plug.open().ok());
    heard.parser.restart();
    std::filesystem::remove(port);
    std::filesystem::create_symlink(plug.path(), port);
  };
  plugIn();
  Vehicle vehicle;
  const auto listen = [&] {
    std::array<std::uint8_t, 4096> bytes;
    std::size_t count = 0;
    while (plug.receive(bytes, count).ok() && count > 0) heard.take(std::span(bytes).first(count));
  };
  const auto fly = [&] {
    vehicle.move();
    listen();
  };
  vehicle.say("the IMU delivers at 0.0 Hz");
  AutopilotThread autopilot(vehicle.outlet, optionsOf(port));
  REQUIRE(until([&] { return !heard.heartbeats.empty() && !heard.texts.empty(); }, listen));
  CHECK(heard.poses.empty());
  CHECK(heard.heartbeats.size() <= mostSince(vehicle.begin, 1) - 1);
  REQUIRE(heard.texts.size() == 1);
  CHECK(heard.texts[0] == "not ready: sensors: the IMU delivers at 0.0 Hz");

  vehicle.say("");
  vehicle.tellHealth(Health::kGood);
  const Stamp off = monotonicNow();
  REQUIRE(until([&] { return heard.poses.size() > 20 && heard.texts.size() > 2; }, fly));
  CHECK(heard.poses.size() <= mostSince(off, 40));
  CHECK(std::ranges::count(heard.texts, "swiftlet: ready to arm") == 1);
  CHECK(std::ranges::count(heard.texts, "swiftlet: good") == 1);
  CHECK(heard.texts.size() == 3);

  MavlinkSender sender;
  std::array<std::uint8_t, kLongestMavlinkFrame> request;
  const std::size_t length = mavlink::write(sender, mavlink::Timesync{0, 123'456'789, 0, 0}, request);
  std::size_t taken = 0;
  const Stamp asked = monotonicNow();
  REQUIRE(plug.send(std::span(request).first(length), taken).ok());
  REQUIRE(until([&] { return !heard.answers.empty(); }, fly));
  CHECK(heard.answers[0].ts1 == 123'456'789);
  CHECK(heard.answers[0].tc1 >= asked.ns);
  CHECK(heard.answers[0].tc1 <= monotonicNow().ns);

  mavlink::Heartbeat px4;
  px4.autopilot = mavlink::Heartbeat::kPx4;
  REQUIRE(plug.send(std::span(request).first(mavlink::write(sender, px4, request)), taken).ok());
  // A state that stands still is not sent again: quality -1 for a second, then nothing.
  const std::size_t moved = heard.poses.size();
  REQUIRE(until([&] { return heard.poses.size() > moved + 2; }, listen));
  pass(1.5, listen);
  for (std::size_t i = moved + 2; i < heard.poses.size(); ++i) CHECK(heard.poses[i].quality == -1);
  const std::size_t told = heard.poses.size();
  pass(0.3, listen);
  CHECK(heard.poses.size() == told);
  checkPoses(heard, vehicle.begin);

  plug.hangUp();
  std::vector<std::string> lines;
  const auto drain = [&] {
    autopilot.drainEvents([&](Stamp, const std::string& line) { lines.push_back(line); });
  };
  const auto said = [&](const char* what) {
    return std::ranges::any_of(lines, [&](const auto& line) { return line.find(what) != std::string::npos; });
  };
  REQUIRE(until([&] { return said("connect it again"); }, drain));
  CHECK(lines.back().find("autopilot (" + port.string() + ")") == 0);
  plugIn();
  const std::size_t before = heard.poses.size();
  REQUIRE(until([&] { return said("works again") && heard.poses.size() > before; },
                [&] {
                  fly();
                  drain();
                }));
  // After a loss poses begin anew.
  CHECK(heard.poses.back().reset_counter != heard.poses[0].reset_counter);
  checkPoses(heard, vehicle.begin);
  const nlohmann::ordered_json counted = autopilot.finish();
  CHECK(counted["poses"].get<std::size_t>() > 20);
  CHECK(counted["faults"].get<int>() >= 1);
  CHECK(counted["timesync_answers"] == 1);
  CHECK(counted["received"]["checksum_failures"] == 0);
}

TEST_CASE("Over UDP, of a log with a clock of its own, with obstacles; silence is said", "[autopilot]") {
  LinkPort far("udp:127.0.0.1:24582@24581", 0);
  REQUIRE(far.open().ok());
  Vehicle vehicle;
  vehicle.clock = Duration::fromSeconds(1234.5);
  Heard heard;
  const auto listen = [&] {
    std::array<std::uint8_t, 2048> bytes;
    std::size_t count = 1;
    for (Stamp at; far.read(bytes, count, at).ok() && count > 0;) heard.take(std::span(bytes).first(count));
  };
  auto options = optionsOf("udp:127.0.0.1:24581@24582");
  options.to_host = [&] { return std::optional(vehicle.clock); };
  AutopilotThread autopilot(vehicle.outlet, options);
  std::vector<std::string> lines;
  const auto enough = [&] { return !lines.empty() && heard.poses.size() > 30 && heard.obstacles.size() > 8; };
  REQUIRE(until(enough, [&] {
    vehicle.move();
    vehicle.showWall();
    autopilot.drainEvents([&](Stamp, const std::string& line) { lines.push_back(line); });
    listen();
  }));
  CHECK(heard.obstacles.size() <= mostSince(vehicle.begin, 10));
  for (const auto& told : heard.obstacles) {
    const double then = static_cast<double>(told.time_usec) * 1e-6 - (vehicle.begin - Stamp{}).seconds();
    // The wall stands at 9 m; the vehicle was within a mesh's age of where it was at the stamp.
    CHECK(std::abs(told.distance_cm[0] * 0.01 - (9 - then)) < 0.3);
  }
  checkPoses(heard, vehicle.begin);
  REQUIRE(lines.size() == 1);
  CHECK(lines[0].find("no MAVLink for 3 s") != std::string::npos);
}

TEST_CASE("A port that is not there at the start is noted, looked for and used when it comes",
          "[autopilot]") {
  const ScratchFolder folder("autopilot_late");
  const std::filesystem::path port = folder.file("by-id");
  Vehicle vehicle;
  AutopilotThread autopilot(vehicle.outlet, optionsOf(port));
  std::vector<std::string> lines;
  const auto drain = [&] {
    vehicle.move();
    autopilot.drainEvents([&](Stamp, const std::string& line) { lines.push_back(line); });
  };
  REQUIRE(until([&] { return !lines.empty(); }, drain));
  CHECK(lines[0].find("autopilot (" + port.string() + "): not there") == 0);
  pass(0.5, drain);
  CHECK(lines.size() == 1);
  PseudoTerminal plug;
  REQUIRE(plug.open().ok());
  std::filesystem::create_symlink(plug.path(), port);
  Heard heard;
  REQUIRE(until([&] { return heard.poses.size() > 5 && lines.size() > 1; },
                [&] {
                  drain();
                  std::array<std::uint8_t, 4096> bytes;
                  std::size_t count = 0;
                  while (plug.receive(bytes, count).ok() && count > 0)
                    heard.take(std::span(bytes).first(count));
                }));
  CHECK(lines[1].find("works again") != std::string::npos);
}

TEST_CASE("An agreed UDP port that another program has is waited for", "[autopilot]") {
  auto other = std::make_unique<LinkPort>("udp:127.0.0.1:24583@24584", 0);
  REQUIRE(other->open().ok());
  Vehicle vehicle;
  AutopilotThread autopilot(vehicle.outlet, optionsOf("udp:127.0.0.1:24583@24584"));
  std::vector<std::string> lines;
  const auto drain = [&] {
    autopilot.drainEvents([&](Stamp, const std::string& line) { lines.push_back(line); });
  };
  REQUIRE(until([&] { return !lines.empty(); }, drain));
  CHECK(lines[0].find("held by another program") != std::string::npos);
  other.reset();
  REQUIRE(until([&] { return lines.size() > 1; }, drain));
  CHECK(lines[1].find("works again") != std::string::npos);
}

TEST_CASE("Settings of a port that no time heals are refused before the flight", "[autopilot]") {
  LiveOutlet outlet;
  const ScratchFolder folder("autopilot_wrong");
  const std::string file = folder.file("no_port");
  std::ofstream(file) << "text";
  try {
    AutopilotThread autopilot(outlet, optionsOf(file));
    FAIL("was opened");
  } catch (const InputError& error) {
    CHECK(error.field == "autopilot.device");
    CHECK(std::string(error.what()).find("not a serial port") != std::string::npos);
  }
  CHECK_THROWS_AS(AutopilotThread(outlet, optionsOf("udp:127.0.0.1")), InputError);
  // Not wrong for good: names are resolved when the network is up. The program ends and is restarted.
  CHECK_THROWS_AS(AutopilotThread(outlet, optionsOf("udp:no-such-host.invalid:14550")), std::runtime_error);
}

}  // namespace
}  // namespace swiftlet::test
