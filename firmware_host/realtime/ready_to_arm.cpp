#include "firmware_host/realtime/ready_to_arm.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numbers>

#include "estimator/core/units.hpp"

namespace swiftlet {
namespace {

__attribute__((format(printf, 4, 5))) void lack(ArmingVerdict& verdict, ArmingCondition condition,
                                                const char* remedy, const char* format, ...) {
  MissingCondition missing{condition, {}, remedy};
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(missing.text.data(), missing.text.size(), format, arguments);
  va_end(arguments);
  // One evaluation calls this function at most kMost times.
  static_cast<void>(verdict.missing.tryPushBack(missing));
}

void checkThreads(const ArmingFacts& facts, ArmingVerdict& verdict) {
  if (facts.flight_threads <= 0) {
    lack(verdict, ArmingCondition::kRights, "start the executor", "no flight thread is running");
  } else if (facts.threads_without_priority > 0) {
    lack(verdict, ArmingCondition::kRights,
         "set realtime.enabled and grant SCHED_FIFO (see the thread table at the start)",
         "%d of %d flight threads have no real-time priority, first: %s", facts.threads_without_priority,
         facts.flight_threads, facts.first_without_priority);
  }
  if (!facts.memory_locked) {
    lack(verdict, ArmingCondition::kMemoryLocked,
         "set realtime.lock_memory and grant memory locking (`ulimit -l unlimited`, CAP_IPC_LOCK)",
         "memory is not locked");
  }
}

void checkClocks(const ArmingFacts& facts, const ArmingSettings& settings, ArmingVerdict& verdict) {
  if (facts.reversed_stamps > 0) {
    lack(verdict, ArmingCondition::kClocks,
         "check for two drivers on one device, or a clock that is being set", "%llu stamps did not advance",
         static_cast<unsigned long long>(facts.reversed_stamps));
  }
  for (std::size_t i = 0; i < kMaxCameras; ++i) {
    if (!facts.off_trigger[i]) continue;
    lack(verdict, ArmingCondition::kClocks,
         "check the trigger line, trigger.delay_us and cameras.exposure_ms; see `swiftlet doctor`",
         "the images of camera %zu do not match the trigger edges", i);
  }
  if (!facts.has_sample || !facts.has_image) {
    lack(verdict, ArmingCondition::kClocks, "wait for the sensors, or check their cables",
         "no %s yet: clocks cannot be compared", facts.has_sample ? "image" : "IMU sample");
    return;
  }
  const Duration offset = facts.newest_sample - facts.newest_image;
  if (offset > settings.sensor_offset || offset < -settings.sensor_offset) {
    lack(verdict, ArmingCondition::kClocks, "check the time synchronization of camera and IMU",
         "the newest IMU sample is %.1f ms after the newest image; allowed are %.1f ms either way",
         offset.seconds() * kToMs, settings.sensor_offset.seconds() * kToMs);
  }
}

void checkSensors(const ArmingFacts& facts, const ArmingSettings& settings, ArmingVerdict& verdict) {
  // Written so that NaN counts as missing.
  const double allowed = settings.imu_rate_tolerance * facts.imu_rate_expected;
  const bool at_rate =
      facts.imu_rate_expected > 0 && std::abs(facts.imu_rate - facts.imu_rate_expected) <= allowed;
  if (facts.has_sample && facts.sample_age > settings.sample_age) {
    lack(verdict, ArmingCondition::kSensors, "check the IMU's cable, bus and power",
         "no IMU sample for %.1f ms", facts.sample_age.seconds() * kToMs);
  } else if (!at_rate) {
    lack(verdict, ArmingCondition::kSensors,
         "check the IMU's rate in its calibration (update_rate), its settings and its bus",
         "the IMU rate is %.1f Hz, expected %.1f Hz within %.0f %%", facts.imu_rate, facts.imu_rate_expected,
         settings.imu_rate_tolerance * kPercent);
  }
  const int cameras = std::min(facts.cameras, static_cast<int>(kMaxCameras));
  if (cameras <= 0) {
    lack(verdict, ArmingCondition::kSensors, "use a calibration with a camera", "the rig has no camera");
  }
  for (int i = 0; i < cameras; ++i) {
    const auto camera = static_cast<std::size_t>(i);
    if (!facts.has_image_of[camera]) {
      lack(verdict, ArmingCondition::kSensors, "check its cable and driver", "no image from camera %d", i);
    } else if (facts.image_age[camera] > settings.image_age) {
      lack(verdict, ArmingCondition::kSensors, "check its cable and driver",
           "no image from camera %d for %.1f ms", i, facts.image_age[camera].seconds() * kToMs);
    }
  }
}

void checkInitialized(const ArmingFacts& facts, const ArmingSettings& settings, ArmingVerdict& verdict) {
  if (!facts.health_good) {
    lack(verdict, ArmingCondition::kInitialized, "hold still, then move gently in view of texture",
         "the estimator's health is not good");
  } else if (facts.health_good_for < settings.steady) {
    lack(verdict, ArmingCondition::kInitialized, "wait",
         "health has been good for %.1f s, %.1f s are required", facts.health_good_for.seconds(),
         settings.steady.seconds());
  }
  if (facts.epoch_steady_for < settings.steady) {
    lack(verdict, ArmingCondition::kInitialized, "wait",
         "the last initialization is %.1f s old, %.1f s are required", facts.epoch_steady_for.seconds(),
         settings.steady.seconds());
  }
}

void checkRecorder(const ArmingFacts& facts, ArmingVerdict& verdict) {
  if (!facts.recorder_wanted) return;
  if (!facts.recorder_running) {
    lack(verdict, ArmingCondition::kRecorder, "check the recording's folder and its free space",
         "the flight recorder is not running");
  } else if (facts.recorder_lost > 0) {
    lack(verdict, ArmingCondition::kRecorder, "record to a faster disk, or start a new recording",
         "the flight recorder has lost %llu records", static_cast<unsigned long long>(facts.recorder_lost));
  }
}

void checkEffort(const ArmingFacts& facts, ArmingVerdict& verdict) {
  if (facts.track_level == 0 && facts.smooth_level == 0) return;
  lack(verdict, ArmingCondition::kEffort,
       "reduce the load of this computer, or lower frontend.max_features and effort.iterations",
       "stages run below full effort: tracking by %d levels, smoothing by %d", facts.track_level,
       facts.smooth_level);
}

void checkMembers(const ArmingFacts& facts, ArmingVerdict& verdict) {
  if (facts.members_unwell == 0) return;
  lack(verdict, ArmingCondition::kMembers,
       "wait if it is late; if it is lost, see events.log and restart the program", "%s is %s: %s%s",
       facts.first_unwell, facts.first_unwell_is, facts.first_unwell_text,
       facts.members_unwell > 1 ? ", and others" : "");
}

void checkMounting(const ArmingFacts& facts, const ArmingSettings& settings, ArmingVerdict& verdict) {
  if (facts.tilted_for < settings.tilted) return;
  const double degrees = facts.vehicle_tilt * 180 / std::numbers::pi;
  // Beyond this the IMU is upside down: the only mounting error with a single remedy (its z points down).
  constexpr double kUpsideDown = 150;
  // The text repeats the remedy, because the autopilot's texts and events show only the text.
  lack(verdict, ArmingCondition::kMounting,
       "level the vehicle; if it is level, correct autopilot.roll_deg, pitch_deg and yaw_deg: the IMU of a "
       "flight controller or of DroneCAN, whose z points down, needs autopilot.roll_deg: 180",
       degrees > kUpsideDown
           ? "the vehicle is upside down (%.0f deg from level): correct autopilot.roll_deg, 180 "
             "for an IMU whose z points down"
           : "the vehicle is %.0f deg from level: correct autopilot.roll_deg, pitch_deg, yaw_deg",
       degrees);
}

}  // namespace

const char* conditionName(ArmingCondition condition) {
  switch (condition) {
    case ArmingCondition::kRights:
      return "rights";
    case ArmingCondition::kMemoryLocked:
      return "memory_locked";
    case ArmingCondition::kClocks:
      return "clocks";
    case ArmingCondition::kSensors:
      return "sensors";
    case ArmingCondition::kInitialized:
      return "initialized";
    case ArmingCondition::kRecorder:
      return "recorder";
    case ArmingCondition::kEffort:
      return "effort";
    case ArmingCondition::kMembers:
      return "members";
    case ArmingCondition::kMounting:
      return "mounting";
  }
  return "unknown";
}

bool ArmingVerdict::lacks(ArmingCondition condition) const {
  return std::any_of(missing.begin(), missing.end(),
                     [condition](const MissingCondition& item) { return item.condition == condition; });
}

ArmingVerdict ReadyToArm::evaluate(const ArmingFacts& facts) const {
  ArmingVerdict verdict;
  checkThreads(facts, verdict);
  checkClocks(facts, settings_, verdict);
  checkSensors(facts, settings_, verdict);
  checkInitialized(facts, settings_, verdict);
  checkRecorder(facts, verdict);
  checkEffort(facts, verdict);
  checkMembers(facts, verdict);
  checkMounting(facts, settings_, verdict);
  return verdict;
}

std::string describe(const ArmingVerdict& verdict) {
  if (verdict.ready()) return "ready to arm\n";
  std::string text;
  for (const MissingCondition& item : verdict.missing) {
    text += std::string(item.name()) + ": " + item.text.data() + "; " + item.remedy + "\n";
  }
  return text;
}

nlohmann::ordered_json toJson(const ArmingVerdict& verdict) {
  nlohmann::ordered_json missing = nlohmann::ordered_json::array();
  for (const MissingCondition& item : verdict.missing) {
    missing.push_back({{"condition", item.name()}, {"what", item.text.data()}, {"remedy", item.remedy}});
  }
  return {{"ready", verdict.ready()}, {"missing", missing}};
}

}  // namespace swiftlet
