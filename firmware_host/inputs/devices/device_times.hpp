#pragma once
// Common to the threads of devices: waiting times, and stamps in seconds.

#include <algorithm>

#include "estimator/core/stamp.hpp"
#include "firmware_host/realtime/stage_timer.hpp"

namespace swiftlet {

/// Period of attempts to open a device that is gone.
inline constexpr Duration kReopenPeriod = Duration::fromMilliseconds(200);
/// Longest wait of a device's thread before it checks whether the flight has ended.
inline constexpr int kPollMilliseconds = 100;
/// First and longest wait between restarts of a device that is present but silent. Some USB cameras need two
/// seconds to their first frame; opening an IMU takes up to three. The wait doubles, because a silent device
/// may be intact, for example a camera without trigger edges.
inline constexpr Duration kFirstRestartWait = Duration::fromMilliseconds(4000);
inline constexpr Duration kLongestRestartWait = Duration::fromMilliseconds(32'000);
/// Longer than any pause of a working device: drops on a busy bus last a few periods.
inline constexpr Duration kLongestSilence = Duration::fromMilliseconds(1000);
/// The same for a device of `rate` [Hz], which may be slow.
inline Duration longestSilence(double rate) {
  constexpr double kPeriods = 3;
  return std::max(kLongestSilence, Duration::fromSeconds(kPeriods / rate));
}

inline double secondsOf(Stamp stamp) { return (stamp - Stamp{}).seconds(); }

}  // namespace swiftlet
