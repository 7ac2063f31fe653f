#pragma once
// Converts stamps of CLOCK_REALTIME, which ROS drivers use, to CLOCK_MONOTONIC with one offset between the
// two clocks, read at the start.
//
// NTP slews both clocks equally, so the offset stays; a step changes only the wall clock. Some drivers follow
// a step (they read the wall clock for each message), others do not (they read it once and continue with the
// device's clock), and messages of both are in transit when it happens. The delay from stamp to arrival shows
// which offset is right: the one that gives the usual delay, which is the smallest of the last seconds.
// - Set ahead: messages of a driver that follows have a delay below the usual one, which lateness cannot
//   cause. The new offset is used at once.
// - Set back: the delay is above the usual one, like that of a late message. Three in a row decide; the first
//   two get no stamp.
//
// The decision stays open for kOpen after a step, and again after a silence, since the driver may have
// restarted.
//
// A stamp more than kFarthest before its arrival, or more than kMostAhead after it, is from another clock and
// is refused; the arrival is never used instead.
//
// Errors: values. Threads: one. O(1), no allocation. Pure: the caller reads the clocks.

#include <cstdint>
#include <optional>

#include "drivers/device/host_clocks.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

class WallStamps {
 public:
  static constexpr Duration kFarthest = Duration::fromMilliseconds(1000);
  /// The error of two computers' clocks that NTP has synchronized.
  static constexpr Duration kMostAhead = Duration::fromMilliseconds(50);
  /// Smaller changes are reading errors: NTP makes no smaller steps.
  static constexpr Duration kSmallestStep = Duration::fromMilliseconds(1);
  static constexpr Duration kOpen = Duration::fromMilliseconds(2000);

  enum class Result : std::uint8_t { kMapped, kWrongClock, kUnsure };

  /// Call before mapping the messages that have arrived. True: the wall clock was set since the last call, by
  /// step().
  bool follow(const HostClocks& now);
  /// `host` is written only if the result is kMapped. Call follow() first.
  Result map(Stamp wall, Stamp arrival, Stamp& host);

  /// Newest step of the wall clock.
  [[nodiscard]] Duration step() const { return step_; }
  [[nodiscard]] std::uint64_t steps() const { return steps_; }
  /// Steps that the driver's stamps followed.
  [[nodiscard]] std::uint64_t followed() const { return followed_; }
  /// Time from the newest refused stamp to its arrival.
  [[nodiscard]] Duration farBy() const { return far_by_; }

 private:
  /// Smallest delay over the last one to two times kLength.
  class RecentSmallest {
   public:
    void add(Stamp now, Duration value);
    void clear() { *this = {}; }
    [[nodiscard]] std::optional<Duration> value() const;

   private:
    static constexpr Duration kLength = Duration::fromMilliseconds(2000);
    Stamp begin_;
    std::optional<Duration> before_, now_;
  };

  [[nodiscard]] Result choose(Duration delay, Duration usual);

  std::optional<HostClocks> clocks_;  ///< newest readings of the host's clocks
  Duration difference_;               ///< wall - monotonic, as used for the stamps
  std::optional<Duration> other_;     ///< the alternative, while the decision is open
  std::optional<Stamp> open_since_;   ///< arrival of the first message since then
  int in_a_row_ = 0;                  ///< messages in a row that fit `other_` better
  std::optional<Stamp> newest_;       ///< arrival
  RecentSmallest delays_;
  Duration step_;
  Duration far_by_;
  std::uint64_t steps_ = 0;
  std::uint64_t followed_ = 0;
};

}  // namespace swiftlet
