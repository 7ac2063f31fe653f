#include "firmware_host/outputs/ros2/ros_clock.hpp"

#include <algorithm>
#include <span>

namespace swiftlet {

void RosClock::follow(const HostClocks& now) {
  if (clocks_ && steppedBetween(*clocks_, now)) ++steps_;
  clocks_ = clocks_ ? betterOf(*clocks_, now) : now;
}

Stamp RosClock::toRosAndBack(Stamp stamp) {
  sent_[sent_count_++ % kRemembered] = {toRos(stamp), stamp};
  return toRos(stamp);
}

Stamp RosClock::fromRos(Stamp ros) const {
  const std::span sent(sent_.data(), std::min<std::uint64_t>(sent_count_, kRemembered));
  const auto found = std::ranges::find(sent, ros, &Sent::ros);
  return found != sent.end() ? found->own : ros - offset();
}

}  // namespace swiftlet
