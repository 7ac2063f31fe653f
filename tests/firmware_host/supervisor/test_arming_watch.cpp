// Readiness that nobody confirms any more: facts that stand still because nothing comes.

#include <catch2/catch.hpp>

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

}  // namespace
}  // namespace swiftlet
