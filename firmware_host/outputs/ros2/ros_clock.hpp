#pragma once
// Converts the run's clock to the wall clock that other ROS processes use and that NTP may step in flight.
// Pure: the caller reads the clocks. For one thread.

#include <array>
#include <cstdint>
#include <optional>

#include "drivers/device/host_clocks.hpp"

namespace swiftlet {

class RosClock {
 public:
  /// Takes the newest reading of the clocks. Without one, stamps are published unchanged.
  void follow(const HostClocks& now);

  [[nodiscard]] Stamp toRos(Stamp stamp) const { return stamp + offset(); }
  /// Like toRos(), and remembers the stamp, for messages that will be answered under it.
  Stamp toRosAndBack(Stamp stamp);
  /// The run's stamp of a published stamp, unaffected by later clock steps; other stamps use the current
  /// offset.
  [[nodiscard]] Stamp fromRos(Stamp ros) const;

  /// Number of steps of the wall clock that exceeded the reading errors.
  [[nodiscard]] std::uint64_t steps() const { return steps_; }

 private:
  /// More than can wait for answers: twice the number of LabelExchange's places.
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
