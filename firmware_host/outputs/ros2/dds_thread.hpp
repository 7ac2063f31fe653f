#pragma once
// The newest results of a run as ROS 2 topics, from its own low-priority thread (docs/ros2.md). It reads a
// LiveOutlet; no thread waits for it. It also receives label images for the map (LabelExchange), at most
// kKeptImages per turn. In builds without SWIFTLET_WITH_DDS the constructor throws an error that says so.

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
  /// Opens and begins. std::runtime_error naming the setting where DDS does not open. `outlet` outlives it.
  DdsThread(LiveOutlet& outlet, const DdsThreadOptions& options);

 private:
  class Work;
};

}  // namespace swiftlet
