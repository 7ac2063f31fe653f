// Ready to arm: all conditions hold, and each, withheld in turn, blocks under its name.

#include <catch2/catch.hpp>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <string>

#include "firmware_host/realtime/ready_to_arm.hpp"

namespace swiftlet {
namespace {

/// Everything as it should be: two cameras at 20 Hz, an IMU at 200 Hz.
ArmingFacts goodFacts() {
  ArmingFacts facts;
  facts.flight_threads = 4;
  facts.memory_locked = true;
  facts.has_sample = true;
  facts.has_image = true;
  facts.newest_sample = Stamp{1'000'000'000};
  facts.newest_image = Stamp{960'000'000};
  facts.imu_rate = 199;
  facts.imu_rate_expected = 200;
  facts.cameras = 2;
  facts.has_image_of = {true, true};
  facts.image_age = {Duration::fromMilliseconds(30), Duration::fromMilliseconds(31)};
  facts.health_good = true;
  facts.health_good_for = Duration::fromMilliseconds(5000);
  facts.epoch_steady_for = Duration::fromMilliseconds(9000);
  facts.recorder_wanted = true;
  facts.recorder_running = true;
  return facts;
}

struct Withheld {
  const char* what;
  ArmingCondition condition;
  std::function<void(ArmingFacts&)> take;
  const char* text;  ///< in the message
};

const Withheld kWithheld[] = {
    {"a priority", ArmingCondition::kRights,
     [](ArmingFacts& f) {
       f.threads_without_priority = 2;
       f.first_without_priority = "track";
     },
     "2 of 4"},
    {"the executor", ArmingCondition::kRights, [](ArmingFacts& f) { f.flight_threads = 0; },
     "no flight thread"},
    {"the lock", ArmingCondition::kMemoryLocked, [](ArmingFacts& f) { f.memory_locked = false; },
     "not locked"},
    {"monotonic stamps", ArmingCondition::kClocks, [](ArmingFacts& f) { f.reversed_stamps = 3; }, "3 stamps"},
    {"images", ArmingCondition::kClocks, [](ArmingFacts& f) { f.has_image = false; }, "no image"},
    {"samples", ArmingCondition::kClocks, [](ArmingFacts& f) { f.has_sample = false; }, "no IMU sample"},
    {"agreement, images behind", ArmingCondition::kClocks,
     [](ArmingFacts& f) { f.newest_image = Stamp{700'000'000}; }, "300.0 ms"},
    {"agreement, images ahead", ArmingCondition::kClocks,
     [](ArmingFacts& f) { f.newest_image = Stamp{1'300'000'000}; }, "-300.0 ms"},
    {"trigger edges that match", ArmingCondition::kClocks, [](ArmingFacts& f) { f.off_trigger[1] = true; },
     "the images of camera 1 do not match"},
    {"a fifth of the rate", ArmingCondition::kSensors, [](ArmingFacts& f) { f.imu_rate = 159; }, "159.0 Hz"},
    {"a rate that was told", ArmingCondition::kSensors, [](ArmingFacts& f) { f.imu_rate = 241; }, "200.0 Hz"},
    {"a rate that is a number", ArmingCondition::kSensors,
     [](ArmingFacts& f) { f.imu_rate = std::numeric_limits<double>::quiet_NaN(); }, "nan"},
    {"samples that go on", ArmingCondition::kSensors,
     [](ArmingFacts& f) { f.sample_age = Duration::fromMilliseconds(150); }, "no IMU sample for 150.0 ms"},
    {"an expected rate", ArmingCondition::kSensors, [](ArmingFacts& f) { f.imu_rate_expected = 0; },
     "0.0 Hz"},
    {"a camera", ArmingCondition::kSensors, [](ArmingFacts& f) { f.has_image_of[1] = false; }, "camera 1"},
    {"a camera's stream", ArmingCondition::kSensors,
     [](ArmingFacts& f) { f.image_age[0] = Duration::fromMilliseconds(700); }, "camera 0"},
    {"a rig", ArmingCondition::kSensors, [](ArmingFacts& f) { f.cameras = 0; }, "no camera"},
    {"health", ArmingCondition::kInitialized, [](ArmingFacts& f) { f.health_good = false; }, "not good"},
    {"health for long", ArmingCondition::kInitialized,
     [](ArmingFacts& f) { f.health_good_for = Duration::fromMilliseconds(2900); }, "2.9 s"},
    {"an epoch for long", ArmingCondition::kInitialized,
     [](ArmingFacts& f) { f.epoch_steady_for = Duration::fromMilliseconds(100); }, "0.1 s"},
    {"the recorder", ArmingCondition::kRecorder, [](ArmingFacts& f) { f.recorder_running = false; },
     "is not running"},
    {"a recording without loss", ArmingCondition::kRecorder, [](ArmingFacts& f) { f.recorder_lost = 9; },
     "lost 9"},
    {"full tracking", ArmingCondition::kEffort, [](ArmingFacts& f) { f.track_level = 1; }, "by 1"},
    {"full smoothing", ArmingCondition::kEffort, [](ArmingFacts& f) { f.smooth_level = 2; }, "by 2"},
    {"a thread", ArmingCondition::kMembers,
     [](ArmingFacts& f) {
       f.members_unwell = 2;
       f.first_unwell = "mesh";
       f.first_unwell_is = "lost";
       f.first_unwell_text = "no memory";
     },
     "mesh is lost: no memory, and others"},
    {"the right way up", ArmingCondition::kMounting,
     [](ArmingFacts& f) {
       f.vehicle_tilt = std::numbers::pi;
       f.tilted_for = Duration::fromMilliseconds(3000);
     },
     "upside down (180 deg from level): correct autopilot.roll_deg, 180"},
    {"a level vehicle", ArmingCondition::kMounting,
     [](ArmingFacts& f) {
       f.vehicle_tilt = std::numbers::pi / 2;
       f.tilted_for = Duration::fromMilliseconds(3000);
     },
     "90 deg from level: correct autopilot.roll_deg, pitch_deg, yaw_deg"},
};

TEST_CASE("with every condition given the vehicle is ready to arm") {
  const ReadyToArm rule;
  const ArmingVerdict verdict = rule.evaluate(goodFacts());
  INFO(describe(verdict));
  CHECK(verdict.ready());
  CHECK(describe(verdict) == "ready to arm\n");
  CHECK(toJson(verdict)["ready"] == true);
  CHECK(toJson(verdict)["missing"].empty());
}

TEST_CASE("each condition withheld blocks by its name and no other") {
  const ReadyToArm rule;
  std::set<ArmingCondition> seen;
  for (const Withheld& withheld : kWithheld) {
    INFO(withheld.what);
    ArmingFacts facts = goodFacts();
    withheld.take(facts);
    const ArmingVerdict verdict = rule.evaluate(facts);
    INFO(describe(verdict));
    CHECK(!verdict.ready());
    REQUIRE(verdict.missing.size() == 1);
    const MissingCondition& missing = verdict.missing[0];
    CHECK(missing.condition == withheld.condition);
    CHECK(verdict.lacks(withheld.condition));
    CHECK(std::string(missing.text.data()).find(withheld.text) != std::string::npos);
    CHECK(std::string(missing.remedy).size() > 3);
    CHECK(describe(verdict).starts_with(std::string(conditionName(withheld.condition)) + ": "));
    CHECK(toJson(verdict)["missing"][0]["condition"] == conditionName(withheld.condition));
    seen.insert(withheld.condition);
  }
  CHECK(seen.size() == kArmingConditions);
}

TEST_CASE("a recorder that is not wanted is not missed") {
  ArmingFacts facts = goodFacts();
  facts.recorder_wanted = false;
  facts.recorder_running = false;
  facts.recorder_lost = 5;
  CHECK(ReadyToArm().evaluate(facts).ready());
}

TEST_CASE("facts that nobody filled in block all but effort, recorder and members") {
  const ArmingVerdict verdict = ReadyToArm().evaluate({});
  for (const ArmingCondition condition :
       {ArmingCondition::kRights, ArmingCondition::kMemoryLocked, ArmingCondition::kClocks,
        ArmingCondition::kSensors, ArmingCondition::kInitialized}) {
    CHECK(verdict.lacks(condition));
  }
  CHECK(!verdict.lacks(ArmingCondition::kRecorder));
}

TEST_CASE("everything missing at once finds room in the verdict") {
  ArmingFacts facts;
  facts.cameras = 100;
  facts.reversed_stamps = 1;
  facts.off_trigger.fill(true);
  facts.recorder_wanted = true;
  facts.track_level = 1;
  facts.members_unwell = 1;
  facts.tilted_for = Duration::fromMilliseconds(9000);
  const ArmingVerdict verdict = ReadyToArm().evaluate(facts);
  for (std::size_t i = 0; i < kArmingConditions; ++i) CHECK(verdict.lacks(static_cast<ArmingCondition>(i)));
  CHECK(verdict.missing.size() == ArmingVerdict::kMost);
}

TEST_CASE("the bounds themselves are allowed") {
  const ArmingSettings settings;
  ArmingFacts facts = goodFacts();
  facts.imu_rate = 160;
  facts.newest_image = facts.newest_sample - settings.sensor_offset;
  facts.image_age[1] = settings.image_age;
  facts.health_good_for = settings.steady;
  facts.epoch_steady_for = settings.steady;
  CHECK(ReadyToArm(settings).evaluate(facts).ready());
}

}  // namespace
}  // namespace swiftlet
