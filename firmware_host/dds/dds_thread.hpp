#pragma once
// The newest of a run as ROS 2's topics, from a low thread of its own at its own pace (docs/ros2.md). It
// reads a LiveOutlet; nobody waits for it. Label images for the map come in by it (LabelExchange), at most
// kKeptImages a turn. In builds without SWIFTLET_WITH_DDS the constructor says so.

#include <memory>
#include <nlohmann/json_fwd.hpp>

#include "firmware_host/pipeline/label_exchange.hpp"
#include "firmware_host/pipeline/live_outlet.hpp"
#include "firmware_host/settings/device_settings.hpp"
#include "firmware_host/supervisor/heartbeat.hpp"

namespace swiftlet {

struct DdsThreadOptions {
  Ros2Group settings;
  /// Added to every stamp: from the run's clock to that of ROS's other processes.
  Duration to_ros_clock{0};
  double gyro_sigma = 0;            ///< rad/s, of one sample: of the angular velocity that goes out
  LabelExchange* labels = nullptr;  ///< shown and filled; null: no labels are taken; outlives the thread
};

class DdsThread {
 public:
  /// Opens and begins. InputError naming the setting where DDS does not open. `outlet` outlives it.
  DdsThread(LiveOutlet& outlet, const DdsThreadOptions& options);
  /// Publishes nothing more, and ends; a thread that is stuck is left behind: `outlet` has to stay then.
  ~DdsThread();
  DdsThread(const DdsThread&) = delete;
  DdsThread& operator=(const DdsThread&) = delete;

  /// For the supervisor; as long as this object.
  [[nodiscard]] const Heartbeat& heart() const;
  /// Ends it, and gives what it counted, for the summary; `fault`: why it ended before, or that it is stuck.
  nlohmann::ordered_json finish();

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

/// From CLOCK_MONOTONIC, which live stamps are of, to CLOCK_REALTIME, which ROS's are: as both are now.
Duration realtimeOffset();

}  // namespace swiftlet
