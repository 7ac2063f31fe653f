#include "drivers/timesync/wall_stamps.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace swiftlet {
namespace {

constexpr Duration kSilence = Duration::fromMilliseconds(1000);
constexpr int kEnough = 3;

Duration size(Duration d) { return {std::abs(d.ns)}; }

}  // namespace

void WallStamps::RecentSmallest::add(Stamp now, Duration value) {
  if (!now_ || now - begin_ > kLength) {
    before_ = std::exchange(now_, std::nullopt);
    begin_ = now;
  }
  now_ = now_ ? std::min(*now_, value) : value;
}

std::optional<Duration> WallStamps::RecentSmallest::value() const {
  return now_ && before_ ? std::min(*now_, *before_) : now_;
}

bool WallStamps::follow(const HostClocks& now) {
  if (!clocks_) {
    clocks_ = now;
    difference_ = now.realtime_ahead;
    return false;
  }
  const Duration step = now.realtime_ahead - clocks_->realtime_ahead;
  if (size(step) < kSmallestStep + now.error + clocks_->error) {
    // Same difference, read more accurately.
    if (now.error < clocks_->error) {
      if (difference_ == clocks_->realtime_ahead) difference_ = now.realtime_ahead;
      clocks_ = now;
    }
    return false;
  }
  clocks_ = now;
  step_ = step;
  ++steps_;
  other_ = now.realtime_ahead;
  open_since_.reset();
  in_a_row_ = 0;
  return true;
}

WallStamps::Result WallStamps::map(Stamp wall, Stamp arrival, Stamp& host) {
  if (newest_ && arrival - *newest_ > kSilence &&
      size(clocks_->realtime_ahead - difference_) > kSmallestStep) {
    other_ = clocks_->realtime_ahead;
    open_since_.reset();
  }
  newest_ = arrival;
  Duration delay = arrival - (wall - difference_);
  if (other_) {
    if (!open_since_) open_since_ = arrival;
    if (arrival - *open_since_ > kOpen) {
      other_.reset();
    } else {
      const Duration before = difference_;
      const Result chosen = choose(delay, delays_.value().value_or(Duration{}));
      if (chosen != Result::kMapped) return chosen;
      delay = delay + (difference_ - before);
    }
  }
  if (delay > kFarthest || delay < -kMostAhead) {
    far_by_ = delay;
    return Result::kWrongClock;
  }
  delays_.add(arrival, delay);
  host = wall - difference_;
  return Result::kMapped;
}

WallStamps::Result WallStamps::choose(Duration delay, Duration usual) {
  const Duration by_other = delay + (*other_ - difference_);
  if (size(by_other - usual) >= size(delay - usual)) {
    in_a_row_ = 0;
    return Result::kMapped;
  }
  // With a smaller difference the message only looks late, and it may really be late.
  if (*other_ < difference_ && ++in_a_row_ < kEnough) return Result::kUnsure;
  in_a_row_ = 0;
  ++followed_;
  std::swap(*other_, difference_);
  return Result::kMapped;
}

}  // namespace swiftlet
