#pragma once
// CLOCK_REALTIME - CLOCK_MONOTONIC, for stamps that the kernel gives in real time only (SocketCAN).
//
// Real time is slewed and stepped, so the offset is measured each second and at each step that is heard of
// (realtime_clock.hpp), from readings A (monotonic), B (real), A': offset = B - (A + A') / 2, wrong by at
// most (A' - A) / 2; the best of ten counts. Readings that contradict each other had a step among them: they
// are refused and the last offset holds until the next measurement.
//
// This is the pure part: readings are data. O(readings), nothing allocated; any stamps, nothing overflows.
// Source: as NTP's reading of two clocks; linux PTP_SYS_OFFSET.

#include <cstdint>
#include <span>

#include "estimator/core/stamp.hpp"
#include "estimator/core/status.hpp"

namespace swiftlet {

struct ClockReading {
  Stamp before;  ///< CLOCK_MONOTONIC
  Stamp real;    ///< CLOCK_REALTIME
  Stamp after;   ///< CLOCK_MONOTONIC
};

class RealtimeOffset {
 public:
  /// Takes the best reading. kInvalidInput: none is in order; kNotReady: a step lies among them, read again.
  Status measure(std::span<const ClockReading> readings);
  /// Whether `now` (monotonic) is a second after the last measurement, or there was none.
  [[nodiscard]] bool due(Stamp now) const;
  /// A step was heard of, or a stamp came out in the future: due at once.
  void expire() { expired_ = true; }

  /// kNotReady before the first measurement; kInvalidInput for a stamp out of range.
  Status toMonotonic(Stamp real, Stamp& monotonic) const;

  [[nodiscard]] Duration offset() const { return offset_; }     ///< real - monotonic
  [[nodiscard]] Duration errorBound() const { return bound_; }  ///< when it was measured
  [[nodiscard]] std::uint64_t steps() const { return steps_; }  ///< beyond what slewing explains

 private:
  Duration offset_;
  Duration bound_;
  Stamp measured_;
  bool any_ = false;
  bool expired_ = false;
  std::uint64_t steps_ = 0;
};

}  // namespace swiftlet
