#pragma once
// Whether a working device sends at the expected rate: messages per second against those expected. It does
// not detect silence; restart it when a device returns. O(1).

#include <cstddef>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

class RateWatch {
 public:
  /// Limits as a share of the expected messages: fewer is a loss, more is noise. A second of the slowest
  /// camera holds 10 messages, of which one may fall outside at the ends of the window.
  static constexpr double kFewest = 0.85;
  static constexpr double kMost = 1.15;

  /// `expected`: messages per second; 0: unknown, no rate is ever wrong.
  explicit RateWatch(double expected) : expected_(expected) {}

  /// Counting starts after the message that arrived at `now`.
  void restart(Stamp now) {
    begin_ = now;
    count_ = 0;
    begun_ = true;
  }
  /// `count` messages have arrived by `now`. True once a second: seen() is new.
  bool add(Stamp now, std::size_t count) {
    if (!begun_) {
      restart(now);
      return false;
    }
    count_ += count;
    if (now - begin_ < kWindow) return false;
    seen_ = static_cast<double>(count_) / (now - begin_).seconds();
    restart(now);
    return true;
  }
  [[nodiscard]] double seen() const { return seen_; }
  [[nodiscard]] double expected() const { return expected_; }
  [[nodiscard]] bool tooFew() const { return seen_ < kFewest * expected_; }
  [[nodiscard]] bool tooMany() const { return expected_ > 0 && seen_ > kMost * expected_; }

 private:
  static constexpr Duration kWindow = Duration::fromMilliseconds(1000);

  double expected_;
  Stamp begin_;
  std::size_t count_ = 0;
  bool begun_ = false;
  double seen_ = 0;
};

}  // namespace swiftlet
