#pragma once
// The host's two clocks at one moment: CLOCK_MONOTONIC, which stamps are of, and CLOCK_REALTIME, the wall's.
// NTP slews both alike and steps the wall's only. Some 0.3 us.

#include <cstdlib>
#include <ctime>

#include "drivers/device/monotonic_now.hpp"

namespace swiftlet {

struct HostClocks {
  Stamp monotonic;
  Duration realtime_ahead;  ///< CLOCK_REALTIME - CLOCK_MONOTONIC
  Duration error;           ///< of realtime_ahead, at most
};

/// The wall clock between two readings of the steady one; of three tries the one that was disturbed least.
[[nodiscard]] inline HostClocks readHostClocks() {
  constexpr int kTries = 3;
  HostClocks best;
  for (int i = 0; i < kTries; ++i) {
    const Stamp before = monotonicNow();
    timespec wall = {};
    clock_gettime(CLOCK_REALTIME, &wall);
    const Stamp after = monotonicNow();
    const Duration error = {(after - before).ns / 2 + 1};
    if (i > 0 && error >= best.error) continue;
    const std::int64_t wall_ns = static_cast<std::int64_t>(wall.tv_sec) * 1'000'000'000 + wall.tv_nsec;
    best = {after, {wall_ns - before.ns - (after - before).ns / 2}, error};
  }
  return best;
}

/// Whether the wall's clock was stepped between two readings: by more than their errors.
[[nodiscard]] inline bool steppedBetween(const HostClocks& older, const HostClocks& newer) {
  return std::abs((newer.realtime_ahead - older.realtime_ahead).ns) > older.error.ns + newer.error.ns;
}

/// The better known of two readings, unless the clock was stepped between them: then the newer.
[[nodiscard]] inline HostClocks betterOf(const HostClocks& older, const HostClocks& newer) {
  return steppedBetween(older, newer) || newer.error <= older.error ? newer : older;
}

}  // namespace swiftlet
