#pragma once
// From the run's clock to that of ROS's other processes, the wall clock, which NTP may step in flight. Pure:
// the clocks are read by whoever calls. For one thread.

#include <array>
#include <cstdint>
#include <optional>

#include "drivers/device/host_clocks.hpp"

namespace swiftlet {

class RosClock {
 public:
  /// Takes the newest reading of the clocks. Without any, stamps go out as they are.
  void follow(const HostClocks& now);

  [[nodiscard]] Stamp toRos(Stamp stamp) const { return stamp + offset(); }
  /// Of something that will be answered under its stamp: toRos, remembered.
  Stamp toRosAndBack(Stamp stamp);
  /// The stamp that went out so, whatever the clock did since; of others by the clock as it is.
  [[nodiscard]] Stamp fromRos(Stamp ros) const;

  /// Of the wall clock, as far as they are larger than the readings' errors.
  [[nodiscard]] std::uint64_t steps() const { return steps_; }

 private:
  /// More than can wait for their answers: twice LabelExchange's places.
  static constexpr std::size_t kRemembered = 16;
  struct Sent {
    Stamp ros, own;
  };

  [[nodiscard]] Duration offset() const { return clocks_ ? clocks_->realtime_ahead : Duration{}; }

  std::optional<HostClocks> clocks_;
  std::uint64_t steps_ = 0;
  std::array<Sent, kRemembered> sent_{};
  std::uint64_t sent_count_ = 0;
};

}  // namespace swiftlet
