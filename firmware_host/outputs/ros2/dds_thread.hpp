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
  /// Read at every turn: live stamps are of CLOCK_MONOTONIC, ROS uses CLOCK_REALTIME. Unset: stamps are
  /// published unchanged.
  std::function<HostClocks()> clocks;
  double gyro_sigma = 0;            ///< rad/s, of one sample; for the published angular velocity
  LabelExchange* labels = nullptr;  ///< images out, labels in; null: no labels; outlives the thread
};

class DdsThread : public Follower {
 public:
  /// Opens DDS and starts the thread. std::runtime_error naming the setting if DDS does not open. `outlet`
  /// outlives this object.
  DdsThread(LiveOutlet& outlet, const DdsThreadOptions& options);

 private:
  class Work;
};

}  // namespace swiftlet
