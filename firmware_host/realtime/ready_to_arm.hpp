#pragma once
// Whether the vehicle may be armed, in the autopilot's sense: every named condition holds, or the verdict
// lists what is missing, with the remedy. Missing conditions block readiness, never running.
//
// Pure: facts in, verdict out; no clock, no files, no heap. The executor collects the facts; times are
// differences that it has measured.
//
// | condition       | holds when
// | `rights`        | every flight thread has its requested priority
// | `memory_locked` | all memory that the flight path uses is locked
// | `clocks`        | no stamp ran backwards recently; newest image and newest sample are close in time;
// |                 | if trigger edges are used, the images of each camera match them
// | `sensors`       | the IMU delivers at its rate, and each camera of the rig delivers
// | `initialized`   | for some seconds, health has been good and the epoch unchanged
// | `recorder`      | the recorder, if requested, runs and has lost nothing
// | `effort`        | the stages work at full effort
// | `members`       | the supervisor finds no faulty thread or sensor
// | `mounting`      | the attitude sent to an autopilot is not far from level

#include <array>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <numbers>
#include <string>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class ArmingCondition {
  kRights,
  kMemoryLocked,
  kClocks,
  kSensors,
  kInitialized,
  kRecorder,
  kEffort,
  kMembers,
  kMounting
};
inline constexpr std::size_t kArmingConditions = 9;

/// "rights", "memory_locked" and so on: the names of the table above.
const char* conditionName(ArmingCondition condition);

struct ArmingFacts {
  int flight_threads = 0;  ///< running; 0: the executor has not started
  int threads_without_priority = 0;
  const char* first_without_priority = "";  ///< its name

  bool memory_locked = false;

  std::uint64_t reversed_stamps = 0;  ///< in the look-back, of all sensors: not later than the previous stamp
  bool has_sample = false;            ///< there is a newest IMU sample
  bool has_image = false;
  Stamp newest_sample;
  Stamp newest_image;

  Duration sample_age;  ///< time since the newest IMU sample arrived
  double imu_rate = 0;  ///< Hz, measured in the look-back
  double imu_rate_expected = 0;
  int cameras = 0;                                ///< in the rig
  std::array<bool, kMaxCameras> has_image_of{};   ///< camera i has delivered since the start
  std::array<Duration, kMaxCameras> image_age{};  ///< time since camera i's newest image arrived
  std::array<bool, kMaxCameras> off_trigger{};    ///< camera i's images match no trigger edges

  bool health_good = false;
  Duration health_good_for;  ///< without interruption until now
  Duration epoch_steady_for;

  bool recorder_wanted = false;
  bool recorder_running = false;
  std::uint64_t recorder_lost = 0;  ///< records lost since the recording began

  int track_level = 0;  ///< levels below full effort
  int smooth_level = 0;

  double vehicle_tilt = 0;  ///< rad, between the world's up and the vehicle's up as sent to the autopilot
  Duration tilted_for;      ///< time beyond ArmingSettings::tilt; 0: not tilted, or no autopilot

  int members_unwell = 0;              ///< in the supervisor's table
  const char* first_unwell = "";       ///< its name
  const char* first_unwell_is = "";    ///< "late", "lost"
  const char* first_unwell_text = "";  ///< "no progress for 0.4 s"
};

/// ArmingWatch raises the image limits for slow cameras.
struct ArmingSettings {
  double imu_rate_tolerance = 0.2;                           ///< share of the expected rate
  Duration sensor_offset = Duration::fromMilliseconds(200);  ///< newest image against newest sample
  Duration sample_age = Duration::fromMilliseconds(100);     ///< of the newest IMU sample
  Duration image_age = Duration::fromMilliseconds(500);      ///< of each camera's newest image
  Duration steady = Duration::fromMilliseconds(3000);        ///< of health and epoch
  /// rad (60 degrees). No vehicle starts on such a slope; a wrong mounting is off by 90 or 180 degrees.
  double tilt = std::numbers::pi / 3;
  /// Equal to `steady`, so that readiness does not precede it; longer than a flip or a roll in flight.
  Duration tilted = Duration::fromMilliseconds(3000);
};

struct MissingCondition {
  static constexpr std::size_t kTextBytes = 160;

  ArmingCondition condition = ArmingCondition::kRights;
  std::array<char, kTextBytes> text{};  ///< what is missing, with numbers; zero-terminated
  const char* remedy = "";              ///< literal

  [[nodiscard]] const char* name() const { return conditionName(condition); }
};

struct ArmingVerdict {
  /// At once, clocks can lack two things and one for each camera, initialized two, and sensors the IMU and
  /// each camera.
  static constexpr std::size_t kMost = kArmingConditions + 2 + 2 * kMaxCameras;

  FixedVector<MissingCondition, kMost> missing;

  [[nodiscard]] bool ready() const { return missing.empty(); }
  [[nodiscard]] bool lacks(ArmingCondition condition) const;
};

class ReadyToArm {
 public:
  explicit ReadyToArm(const ArmingSettings& settings = {}) : settings_(settings) {}

  /// O(1), no heap.
  [[nodiscard]] ArmingVerdict evaluate(const ArmingFacts& facts) const;

 private:
  ArmingSettings settings_;
};

/// One line for each missing condition: `name: what is missing; remedy`. "ready to arm" if none is missing.
std::string describe(const ArmingVerdict& verdict);
/// {"ready": bool, "missing": [{"condition", "what", "remedy"}]}
nlohmann::ordered_json toJson(const ArmingVerdict& verdict);

}  // namespace swiftlet
