#include "firmware_host/outputs/ros2/ros_clock.hpp"

#include <algorithm>
#include <cstdlib>
#include <span>

namespace swiftlet {
namespace {

/// adjtimex() lets the length of a tick differ by 10 %: no clock is slewed faster.
constexpr std::int64_t kSlewShare = 10;

}  // namespace

void RosClock::follow(const HostClocks& now) {
  if (last_) {
    const std::int64_t change = std::abs((now.realtime_ahead - offset_).ns);
    const std::int64_t slewed = (now.monotonic - last_->monotonic).ns / kSlewShare;
    if (change > slewed + last_->error.ns + now.error.ns) ++steps_;
  }
  last_ = now;
  offset_ = now.realtime_ahead;
}

Stamp RosClock::toRosAndBack(Stamp stamp) {
  sent_[sent_count_++ % kRemembered] = {toRos(stamp), stamp};
  return toRos(stamp);
}

Stamp RosClock::fromRos(Stamp ros) const {
  const std::span sent(sent_.data(), std::min<std::uint64_t>(sent_count_, kRemembered));
  const auto found = std::ranges::find(sent, ros, &Sent::ros);
  return found != sent.end() ? found->own : ros - offset_;
}

}  // namespace swiftlet
