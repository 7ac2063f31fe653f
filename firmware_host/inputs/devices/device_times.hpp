#pragma once
// What the threads of devices have in common: how long they wait, and the host's clock as a Stamp.

#include <algorithm>

#include "drivers/device/monotonic_now.hpp"
#include "estimator/core/stamp.hpp"
#include "firmware_host/realtime/stage_timer.hpp"

namespace swiftlet {

/// How often a device that is gone is looked for.
inline constexpr Duration kReopenPeriod = Duration::fromMilliseconds(200);
/// Longest wait of a device's thread before it checks whether the flight has ended.
inline constexpr int kPollMilliseconds = 100;
/// Wait between restarts of a device that is there but silent: first and longest. Some USB cameras need two
/// seconds to their first frame, an IMU up to three to be opened. The wait doubles, because a device may be
/// silent without being broken, as a camera without trigger edges.
inline constexpr Duration kFirstRestartWait = Duration::fromMilliseconds(4000);
inline constexpr Duration kLongestRestartWait = Duration::fromMilliseconds(32'000);
/// Longer than any pause of a sound device: drops on a busy bus take some periods of it.
inline constexpr Duration kLongestSilence = Duration::fromMilliseconds(1000);
/// The same for a device of `rate` Hz, which may be slow.
inline Duration longestSilence(double rate) {
  constexpr double kPeriods = 3;
  return std::max(kLongestSilence, Duration::fromSeconds(kPeriods / rate));
}

/// CLOCK_MONOTONIC.
inline Stamp hostNow() { return monotonicNow(); }
inline double secondsOf(Stamp stamp) { return (stamp - Stamp{}).seconds(); }

}  // namespace swiftlet
