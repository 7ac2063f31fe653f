#pragma once
// The newest of a run as ROS 2's topics, from a low thread of its own at its own pace (docs/ros2.md). It
// reads a LiveOutlet; nobody waits for it. Label images for the map come in by it (LabelExchange), at most
// kKeptImages a turn. In builds without SWIFTLET_WITH_DDS the constructor says so.

#include <functional>

#include "drivers/device/host_clocks.hpp"
#include "firmware_host/interfaces/follower_thread.hpp"
#include "firmware_host/interfaces/label_exchange.hpp"
#include "firmware_host/interfaces/live_outlet.hpp"
#include "firmware_host/settings/device_settings.hpp"

namespace swiftlet {

struct DdsThreadOptions {
  Ros2Group settings;
  /// Read at every turn: live stamps are of CLOCK_MONOTONIC, ROS's of CLOCK_REALTIME. Null: stamps go out as
  /// they are.
  std::function<HostClocks()> clocks;
  double gyro_sigma = 0;            ///< rad/s, of one sample: of the angular velocity that goes out
  LabelExchange* labels = nullptr;  ///< shown and filled; null: no labels are taken; outlives the thread
};

class DdsThread : public Follower {
 public:
  /// Opens and begins. InputError naming the setting where DDS does not open. `outlet` outlives it.
  DdsThread(LiveOutlet& outlet, const DdsThreadOptions& options);

 private:
  class Work;
};

}  // namespace swiftlet
