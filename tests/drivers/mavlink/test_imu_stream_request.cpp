// What is asked of an autopilot about its inertial stream, by seconds of a scripted one.

#include <catch2/catch.hpp>

#include <vector>

#include "drivers/mavlink/imu_stream_request.hpp"

namespace swiftlet {
namespace {

constexpr double kRate = 200;

/// Ten steps a second of an autopilot that beats once a second.
struct Script {
  ImuStreamRequest stream{kRate};
  Stamp now{50'000'000'000};
  bool beats = true;
  int tenths = 0;
  std::vector<mavlink::CommandLong> asked;
  std::vector<std::string> remarks;

  /// `rate`: readings that come of the message that is taken.
  void pass(double seconds, double rate) {
    for (int i = 0; i < static_cast<int>(seconds * 10); ++i, ++tenths) {
      now = now + Duration::fromMilliseconds(100);
      if (beats && tenths % 10 == 0) {
        mavlink::Heartbeat beat;
        beat.autopilot = 3;
        stream.hear(beat, 7, 1, now);
      }
      stream.count(static_cast<std::uint64_t>(rate / 10));
      if (const auto command = stream.step(now)) asked.push_back(*command);
      DeviceFault remark;
      while (stream.nextRemark(remark)) remarks.push_back(describe(remark, "IMU"));
    }
  }
  void answer(std::uint8_t result) { stream.hear(mavlink::CommandAck{511, result}, 7); }
};

TEST_CASE("Asked once where the rate is reached, of the autopilot that beats", "[mavlink]") {
  Script script;
  script.pass(60, 196);
  REQUIRE(script.asked.size() == 1);
  const mavlink::CommandLong& command = script.asked[0];
  CHECK(command.command == 511);
  CHECK(command.param[0] == 105);
  CHECK(command.param[1] == 5000);
  CHECK(command.target_system == 7);
  CHECK(command.target_component == 1);
  CHECK(script.stream.seen() == Approx(190).margin(10));
  CHECK(script.remarks.empty());
}

TEST_CASE("Nothing is asked of nobody, nor of a ground station, nor without a rate", "[mavlink]") {
  Script script;
  script.beats = false;
  script.pass(10, 50);
  mavlink::Heartbeat station;
  station.type = 6;
  script.stream.hear(station, 255, 190, script.now);
  script.pass(2, 50);
  CHECK(script.asked.empty());
  Script any;
  any.stream = ImuStreamRequest(0);
  any.pass(10, 50);
  CHECK(any.asked.empty());
}

TEST_CASE("A rate that is lost is asked for again, the same at first", "[mavlink]") {
  Script script;
  script.pass(10, 200);
  script.pass(0.6, 50);  // until a second has been counted, and a little
  REQUIRE(script.asked.size() == 2);
  CHECK(script.asked[1].param[1] == 5000);
  script.pass(10, 200);
  CHECK(script.asked.size() == 2);
}

TEST_CASE("A rate that is not reached is asked for higher, twice at most, and said once", "[mavlink]") {
  Script script;
  script.pass(60, 170);
  REQUIRE(script.asked.size() > 6);
  CHECK(script.asked[1].param[1] == 5000);
  CHECK(script.asked[2].param[1] == 4000);
  for (const mavlink::CommandLong& command : script.asked) CHECK(command.param[1] >= 2500);
  CHECK(script.asked.back().param[1] == 2500);
  REQUIRE(script.remarks.size() == 1);
  CHECK_THAT(script.remarks[0],
             Catch::Contains("HIGHRES_IMU: 400 per second requested, 170 received, 200 required"));
  script.pass(20, 200);
  const std::size_t before = script.asked.size();
  script.pass(20, 200);
  CHECK(script.asked.size() == before);
}

TEST_CASE("Where HIGHRES_IMU does not come, RAW_IMU is taken, and after it SCALED_IMU", "[mavlink]") {
  Script silent;
  silent.pass(4.5, 0);
  CHECK(silent.stream.message() == 27);
  CHECK(silent.asked.back().param[0] == 27);
  silent.pass(4.5, 0);
  CHECK(silent.stream.message() == 26);
  CHECK(silent.asked.back().param[0] == 26);
  silent.pass(60, 200);
  CHECK(silent.stream.message() == 26);
  CHECK_THAT(silent.remarks.at(0), Catch::Contains("no HIGHRES_IMU received, requesting RAW_IMU"));
  CHECK(silent.remarks.size() == 2);

  Script refusing;
  refusing.pass(0.5, 0);
  refusing.answer(4);
  refusing.pass(1.5, 0);
  CHECK(refusing.stream.message() == 27);  // sooner: it was refused
  // A refusal of what comes changes nothing.
  refusing.answer(4);
  refusing.pass(10, 200);
  CHECK(refusing.stream.message() == 27);
}

TEST_CASE("An autopilot that returns is asked from the beginning", "[mavlink]") {
  Script script;
  script.pass(9, 0);
  REQUIRE(script.stream.message() != 105);
  script.beats = false;
  script.pass(8, 0);
  const std::size_t before = script.asked.size();
  script.beats = true;
  script.pass(10, 200);
  CHECK(script.stream.message() == 105);
  REQUIRE(script.asked.size() == before + 1);
  CHECK(script.asked.back().param[0] == 105);
  CHECK(script.asked.back().param[1] == 5000);
}

}  // namespace
}  // namespace swiftlet
