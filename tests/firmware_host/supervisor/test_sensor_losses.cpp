// Sensors that fall silent, values that stand still, stages that turn without a product, and files that fail.

#include <catch2/catch.hpp>
#include <cstdint>
#include <cstdio>

#include "firmware_host/supervisor/equal_readings.hpp"
#include "tests/firmware_host/supervisor/simulated_flight.hpp"

namespace swiftlet {
namespace {

using test::kSaidWithin;
using test::SimulatedFlight;

TEST_CASE("a silent IMU fails the health until it is back", "[supervisor]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  flight.imu_silent = true;
  CHECK(flight.until([&] { return flight.trouble("imu", Cause::kNoData) != nullptr; }) < 0.1 + kSaidWithin);
  CHECK(flight.verdict.health == Health::kDegraded);
  CHECK(flight.verdict.arming.lacks(ArmingCondition::kSensors));
  CHECK(flight.until([&] { return flight.verdict.health == Health::kFailed; }) < 1.0 + kSaidWithin);
  CHECK_FALSE(flight.verdict.run_failed);
  flight.imu_silent = false;
  flight.pass(5.0);
  CHECK(flight.verdict.health == Health::kGood);
  CHECK(flight.verdict.arming.ready());
  CHECK(flight.times("imu has recovered") == 1);
}

TEST_CASE("one silent camera degrades and is not ready to arm", "[supervisor]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  flight.camera_silent[1] = true;
  CHECK(flight.until([&] { return flight.trouble("camera1", Cause::kNoData) != nullptr; }) <
        0.5 + kSaidWithin);
  CHECK(flight.verdict.health == Health::kDegraded);
  CHECK(flight.verdict.arming.lacks(ArmingCondition::kSensors));
  flight.pass(10.0);
  CHECK(flight.verdict.health == Health::kDegraded);
  CHECK(flight.times("camera1 is lost: no image for 2.") == 1);
  CHECK_FALSE(flight.verdict.run_failed);
}

TEST_CASE("two silent cameras: never ready to arm, the health is the estimator's own", "[supervisor]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  REQUIRE(flight.verdict.arming.ready());
  flight.camera_silent = {true, true};
  CHECK(flight.until([&] { return !flight.verdict.arming.ready(); }) < 0.5 + kSaidWithin);
  CHECK(flight.until([&] { return flight.verdict.health == Health::kDegraded; }) < 0.5 + kSaidWithin);
  // States go on and say how old the newest accepted image is.
  flight.facts.estimate.state_health = Health::kFailed;
  flight.pass(0.2);
  CHECK(flight.verdict.health == Health::kFailed);
  CHECK_FALSE(flight.verdict.run_failed);
  for (int i = 0; i < 100; ++i) {
    flight.pass(0.1);
    REQUIRE_FALSE(flight.verdict.arming.ready());
  }
}

TEST_CASE("a silent trigger degrades", "[supervisor]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  flight.trigger_silent = true;
  CHECK(flight.until([&] { return flight.trouble("trigger", Cause::kNoData) != nullptr; }) <
        1.0 + kSaidWithin);
  CHECK(flight.verdict.health == Health::kDegraded);
  CHECK(flight.verdict.arming.lacks(ArmingCondition::kMembers));
  flight.trigger_silent = false;
  flight.pass(0.2);
  CHECK(flight.verdict.arming.ready());
}

TEST_CASE("a sensor that never delivers is told after its time to start", "[supervisor]") {
  SimulatedFlight flight;
  flight.camera_silent[0] = true;
  flight.pass(9.0);
  CHECK(flight.trouble("camera0", Cause::kNoData) == nullptr);
  flight.pass(1.5);
  REQUIRE(flight.trouble("camera0", Cause::kNoData) != nullptr);
  CHECK(flight.times("camera0 is late: no image since the start") == 1);
}

TEST_CASE("silence is measured on the run's clock", "[supervisor]") {
  SimulatedFlight flight(false, 0.1);
  flight.pass(8.0);
  flight.camera_silent[1] = true;
  flight.pass(4.0);
  CHECK(flight.trouble("camera1", Cause::kNoData) == nullptr);
  flight.pass(1.5);
  CHECK(flight.trouble("camera1", Cause::kNoData) != nullptr);
}

TEST_CASE("states that do not come while samples do", "[supervisor]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  flight.no_states = true;
  CHECK(flight.until([&] { return flight.trouble("propagate", Cause::kNoProduct) != nullptr; }) <
        0.3 + kSaidWithin);
  CHECK(flight.times("propagate is late: no state for") == 1);
  CHECK_FALSE(flight.verdict.arming.ready());
  flight.pass(3.0);
  CHECK(flight.verdict.health == Health::kFailed);
  flight.no_states = false;
  flight.pass(0.2);
  CHECK(flight.verdict.health == Health::kGood);
  // Without samples there is nothing to make states of: that is the IMU's fault alone.
  flight.imu_silent = true;
  flight.pass(5.0);
  CHECK(flight.trouble("propagate", Cause::kNoProduct) == nullptr);
}

TEST_CASE("frames that do not come while images do", "[supervisor]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  flight.no_frames = true;
  CHECK(flight.until([&] { return flight.trouble("smooth", Cause::kNoProduct) != nullptr; }) <
        1.0 + kSaidWithin);
  CHECK_FALSE(flight.verdict.arming.ready());
  flight.no_frames = false;
  flight.pass(0.2);
  CHECK(flight.verdict.troubles.empty());
}

TEST_CASE("an IMU that repeats one reading fails the health", "[supervisor]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  flight.facts.equal_samples = 99;
  flight.pass(0.2);
  CHECK(flight.verdict.health == Health::kGood);
  flight.facts.equal_samples = 100;
  flight.pass(0.2);
  CHECK(flight.verdict.health == Health::kFailed);
  CHECK(flight.times("imu is lost: 100 identical samples in a row") == 1);
  CHECK_FALSE(flight.verdict.arming.ready());
  flight.facts.equal_samples = 1;
  flight.pass(0.2);
  CHECK(flight.verdict.health == Health::kGood);
}

TEST_CASE("equal readings are counted, whatever their stamps", "[supervisor]") {
  EqualReadings readings;
  ImuSample sample = {Stamp{1}, {0.1, 0.2, 0.3}, {0, 0, 9.8}};
  CHECK(readings.note(sample) == 1);
  sample.stamp = Stamp{2};
  CHECK(readings.note(sample) == 2);
  sample.accel.z() += 1e-6;
  CHECK(readings.note(sample) == 1);
  for (int i = 2; i <= 200; ++i) CHECK(readings.note(sample) == static_cast<std::uint64_t>(i));
}

TEST_CASE("files that fail cost neither the flight nor its arming", "[supervisor]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  std::snprintf(flight.facts.file_problem.data(), flight.facts.file_problem.size(), "no space left");
  flight.pass(0.2);
  CHECK(flight.verdict.health == Health::kDegraded);
  CHECK(flight.times("files is lost: no space left") == 1);
  CHECK(flight.verdict.arming.ready());
  CHECK_FALSE(flight.verdict.run_failed);
}

}  // namespace
}  // namespace swiftlet
