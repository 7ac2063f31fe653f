#pragma once
// Converts stamps of CLOCK_REALTIME, which ROS drivers use, to CLOCK_MONOTONIC with one offset between the
// two clocks, read at the start.
//
// NTP slews both clocks alike, so the offset stays; a step changes only the wall clock. Some drivers follow a
// step (they read the wall clock for each message), others do not (they read it once and continue with the
// device's clock), and messages of both are in transit when it happens. The right offset shows in the delay
// from stamp to arrival, whose usual value is the smallest of the last seconds:
// - Set ahead: a message of a driver that follows has a delay below the usual one, which lateness cannot
//   cause. The new offset is used at once.
// - Set back: the delay is above the usual one, as for a late message. Three in a row are accepted; the first
//   two get no stamp.
//
// The choice stays open for kOpen after a step, and after a silence, in which a driver may have restarted.
//
// A stamp farther than kFarthest from its arrival is from another clock and is rejected; the arrival is never
// used instead.
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
  /// Smaller steps of the wall clock than any that NTP makes are the readings' own errors.
  static constexpr Duration kSmallestStep = Duration::fromMilliseconds(1);
  static constexpr Duration kOpen = Duration::fromMilliseconds(2000);

  enum class Result : std::uint8_t { kMapped, kWrongClock, kUnsure };

  /// Call before mapping the messages that have arrived. True: the wall clock was set since the last call, by
  /// step().
  bool follow(const HostClocks& now);
  /// `host` is written where the result is kMapped. follow() came before.
  Result map(Stamp wall, Stamp arrival, Stamp& host);

  /// Of the wall clock, the newest.
  [[nodiscard]] Duration step() const { return step_; }
  [[nodiscard]] std::uint64_t steps() const { return steps_; }
  /// Steps that the stamps followed.
  [[nodiscard]] std::uint64_t followed() const { return followed_; }
  /// From the newest stamp that was refused to its arrival.
  [[nodiscard]] Duration farBy() const { return far_by_; }

 private:
  /// Of delays, over one to two times its length.
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

  std::optional<HostClocks> clocks_;  ///< as they are
  Duration difference_;               ///< wall - monotonic of the stamps, in use
  std::optional<Duration> other_;     ///< that may be theirs, while the choice is open
  std::optional<Stamp> open_since_;   ///< the first message's arrival since then
  int in_a_row_ = 0;                  ///< messages that are nearer to the usual by `other_`
  std::optional<Stamp> newest_;       ///< arrival
  RecentSmallest delays_;
  Duration step_;
  Duration far_by_;
  std::uint64_t steps_ = 0;
  std::uint64_t followed_ = 0;
};

}  // namespace swiftlet
