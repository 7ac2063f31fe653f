#pragma once
// The newest of a run as ROS 2's topics, from a low thread of its own at its own pace (docs/ros2.md). It
// reads a LiveOutlet; nobody waits for it. Label images for the map come in by it (LabelExchange), at most
// kKeptImages a turn. In builds without SWIFTLET_WITH_DDS the constructor says so.

#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>

#include "drivers/device/host_clocks.hpp"
#include "firmware_host/interfaces/label_exchange.hpp"
#include "firmware_host/interfaces/live_outlet.hpp"
#include "firmware_host/settings/device_settings.hpp"
#include "firmware_host/supervisor/heartbeat.hpp"

namespace swiftlet {

struct DdsThreadOptions {
  Ros2Group settings;
  /// Read at every turn: live stamps are of CLOCK_MONOTONIC, ROS's of CLOCK_REALTIME. Null: stamps go out as
  /// they are.
  std::function<HostClocks()> clocks;
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
  /// Tells it to end, and waits for nothing: so that several end at the same time.
  void tellEnd();
  /// Ends it, and gives what it counted, for the summary; `fault`: why it ended before, or that it is stuck.
  nlohmann::ordered_json finish();

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace swiftlet
