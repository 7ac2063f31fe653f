// Readiness that nobody confirms any more: facts that stand still because nothing comes.

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include "firmware_host/realtime/ready_to_arm.hpp"
#include "tests/firmware_host/supervisor/simulated_flight.hpp"

namespace swiftlet {
namespace {

using test::SimulatedFlight;

TEST_CASE("readiness does not outlive its sensors", "[arming]") {
  // With everything silent no frame comes, so that a verdict made of frames would stand as it was.
  const auto silence = [](SimulatedFlight& flight, bool imu, bool cameras) {
    flight.pass(8.0);
    REQUIRE(flight.verdict.arming.ready());
    flight.imu_silent = imu;
    flight.camera_silent = {cameras, cameras};
    flight.pass(1.0);
    CHECK_FALSE(flight.verdict.arming.ready());
    CHECK(flight.verdict.arming.lacks(ArmingCondition::kSensors));
    CHECK(flight.told.back().text.starts_with("not ready to arm: "));
  };
  SimulatedFlight blind, numb, dead;
  silence(blind, false, true);
  silence(numb, true, false);
  silence(dead, true, true);
  // The estimate's last word is good in all of them.
  CHECK(dead.facts.estimate.frame_health == Health::kGood);
}

TEST_CASE("images that do not match the trigger edges take readiness away", "[arming]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  REQUIRE(flight.verdict.arming.ready());
  flight.facts.off_trigger[0] = true;
  flight.pass(0.2);
  CHECK(flight.verdict.arming.lacks(ArmingCondition::kClocks));
}

TEST_CASE("a rate that was right when the IMU fell silent is not enough", "[arming]") {
  ArmingFacts facts;
  facts.flight_threads = 1;
  facts.memory_locked = true;
  facts.has_sample = facts.has_image = true;
  facts.imu_rate = facts.imu_rate_expected = 200;
  facts.cameras = 1;
  facts.has_image_of = {true};
  facts.health_good = true;
  facts.health_good_for = facts.epoch_steady_for = Duration::fromMilliseconds(5000);
  REQUIRE(ReadyToArm().evaluate(facts).ready());
  facts.sample_age = Duration::fromMilliseconds(150);
  const ArmingVerdict verdict = ReadyToArm().evaluate(facts);
  CHECK(verdict.lacks(ArmingCondition::kSensors));
}

TEST_CASE("readiness ends with the health of a frame that is not confirmed", "[arming]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  REQUIRE(flight.verdict.arming.ready());
  flight.no_frames = true;
  flight.pass(1.5);
  CHECK(flight.verdict.arming.lacks(ArmingCondition::kInitialized));
}

TEST_CASE("stamps that went back for good do not keep the vehicle on the ground", "[arming]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  REQUIRE(flight.verdict.arming.ready());
  flight.stamp_shift = Duration::fromSeconds(-3600);
  flight.pass(4.0);
  CHECK(flight.verdict.arming.ready());
}

TEST_CASE("a new epoch takes readiness away for its time", "[arming]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  ++flight.facts.estimate.epoch;
  flight.pass(1.0);
  CHECK(flight.verdict.arming.lacks(ArmingCondition::kInitialized));
  flight.pass(3.0);
  CHECK(flight.verdict.arming.ready());
}

TEST_CASE("slow cameras are no late cameras", "[arming]") {
  // At 1 Hz, between images, the newest sample is up to a second newer and the newest image as old.
  const double rate = GENERATE(1.0, 2.0, 4.0);
  SimulatedFlight flight(true, 1, nullptr, {}, rate);
  flight.pass(8.0);
  CHECK(flight.verdict.arming.ready());
  for (int i = 0; i < 50; ++i) {
    flight.pass(0.1);
    REQUIRE(flight.verdict.arming.ready());
  }
  CHECK(flight.verdict.troubles.empty());
  CHECK(flight.times("ready to arm") == 1);
  CHECK(flight.times("camera0 is") == 0);
  // Silence is still found: late after two and a half periods, lost after twice as long.
  flight.camera_silent[0] = true;
  const auto is = [&](Condition condition) {
    return [&flight, condition] {
      const Trouble* found = flight.trouble("camera0", Cause::kNoData);
      return found != nullptr && found->condition == condition;
    };
  };
  const double late = flight.until(is(Condition::kLate));
  CHECK(late > std::max(0.5, 2.5 / rate) - 1 / rate - 0.2);
  CHECK(late < std::max(0.5, 2.5 / rate) + 0.2);
  CHECK(flight.until(is(Condition::kLost)) < std::max(2.0, 5 / rate));
  CHECK_FALSE(flight.verdict.arming.ready());
}

TEST_CASE("a mounting that turns the vehicle over keeps it on the ground", "[arming]") {
  // The IMU of a flight controller, z down, with the mounting of one whose z points up.
  SimulatedFlight flight(true, 1, nullptr, std::array<double, 3>{0, 0, 1});
  flight.facts.estimate.world_up = {0, 0, -1};
  flight.pass(8.0);
  CHECK(flight.verdict.arming.missing.size() == 1);
  CHECK(flight.verdict.arming.lacks(ArmingCondition::kMounting));
  CHECK(flight.times("ready to arm") == 0);
  CHECK(flight.told.back().text ==
        "not ready to arm: mounting (the vehicle is upside down (180 deg from level): correct "
        "autopilot.roll_deg, 180 for an IMU whose z points down)");

  SimulatedFlight right(true, 1, nullptr, std::array<double, 3>{0, 0, -1});
  right.facts.estimate.world_up = {0, 0, -1};
  right.pass(8.0);
  CHECK(right.verdict.arming.ready());
}

TEST_CASE("a flip in flight is no mounting, and nobody without an autopilot has one", "[arming]") {
  SimulatedFlight flight(true, 1, nullptr, std::array<double, 3>{0, 0, 1});
  flight.pass(8.0);
  flight.facts.estimate.world_up = {0, 0, -1};
  flight.pass(2.0);
  CHECK(flight.verdict.arming.ready());
  flight.pass(2.0);
  CHECK(flight.verdict.arming.lacks(ArmingCondition::kMounting));
  flight.facts.estimate.world_up = {0.5, 0, std::sqrt(0.75)};  // a slope of 30 degrees
  flight.pass(0.2);
  CHECK(flight.verdict.arming.ready());

  SimulatedFlight alone;
  alone.facts.estimate.world_up = {0, 0, -1};
  alone.pass(8.0);
  CHECK(alone.verdict.arming.ready());
}

}  // namespace
}  // namespace swiftlet
