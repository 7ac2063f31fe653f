#pragma once
// Facts that the supervisor needs about a flight: plain values that the schedule collects ten times a second.
// Host times are CLOCK_MONOTONIC; other stamps use the run's clock (the log's in a replay).

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/nav_state.hpp"

namespace swiftlet {

/// Facts that are known before the first message and do not change.
struct FlightGround {
  int flight_threads = 0;
  int threads_without_priority = 0;
  std::array<char, 16> first_without_priority{};  ///< name; zero-terminated
  bool memory_locked = false;
  double imu_rate = 0;     ///< Hz, from the calibration
  double speed = 1;        ///< speed of the run's clock relative to the host's
  int cameras = 0;         ///< in use
  double camera_rate = 0;  ///< Hz, configured; 0: unknown, limits are those of fast cameras
  bool trigger = false;
  bool recorder_wanted = false;
  /// The vehicle's up in the IMU's axes, from autopilot.roll_deg and so on; empty: there is no autopilot.
  std::optional<std::array<double, 3>> vehicle_up;
  bool host_stamps = true;  ///< the run's clock is CLOCK_MONOTONIC
};

/// Limit for missing images: at least `limit`, and two and a half periods of slow cameras. So one image may
/// be lost and the next one late by half a period.
inline Duration imageLimit(Duration limit, double camera_rate) {
  constexpr double kPeriods = 2.5;
  if (!(camera_rate > 0)) return limit;
  return std::max(limit, Duration::fromSeconds(kPeriods / camera_rate));
}

/// What one sensor delivered.
struct SensorNews {
  std::uint64_t messages = 0;
  std::uint64_t reversed_stamps = 0;  ///< stamps not later than the previous one
  Stamp newest;                       ///< on the run's clock; only if messages > 0
  Stamp arrival;                      ///< of the newest message, on the host's clock
};

/// The newest state of the estimate.
struct EstimateNews {
  std::uint64_t states = 0;  ///< states propagated
  Health state_health = Health::kInitializing;
  std::uint64_t frames = 0;  ///< frames smoothed, or waiting for initialization
  Stamp frame;
  bool has_state = false;
  Health frame_health = Health::kInitializing;
  std::uint32_t epoch = 0;
  int track_level = 0;  ///< levels below full effort
  int smooth_level = 0;
  std::array<double, 3> world_up{0, 0, 1};  ///< in the IMU's axes, at the newest frame
};

struct FlightFacts {
  static constexpr std::size_t kTextBytes = 128;

  SensorNews imu;
  std::array<SensorNews, kMaxCameras> camera;
  SensorNews trigger;
  std::array<bool, kMaxCameras> off_trigger{};  ///< camera i's images match no trigger edges
  std::uint64_t equal_samples = 0;              ///< of the IMU, as counted by EqualReadings
  EstimateNews estimate;
  bool recorder_running = false;
  std::uint64_t recorder_lost = 0;              ///< records lost
  std::array<char, kTextBytes> file_problem{};  ///< empty: all files are written; zero-terminated
  /// The run is ending in order: threads may return, sensors may fall silent. Set before the first thread
  /// returns for this reason.
  bool ending = false;
};

}  // namespace swiftlet
