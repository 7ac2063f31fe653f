#include "firmware_host/commands/live_consumers.hpp"

namespace swiftlet {

LiveConsumers::LiveConsumers(const Settings& settings, const FlightRequest& request) {
  if (settings.ros2.enabled) {
    ros2_ = std::make_unique<DdsThread>(
        newOutlet(ros2_outlet_),
        DdsThreadOptions{settings.ros2, request.host_stamps ? realtimeOffset() : Duration{0}});
  }
}

LiveOutlet& LiveConsumers::newOutlet(std::unique_ptr<LiveOutlet>& owner) {
  owner = std::make_unique<LiveOutlet>();
  static_cast<void>(outlets_.tryPushBack(owner.get()));
  return *owner;
}

void LiveConsumers::finish(nlohmann::ordered_json& report) {
  if (ros2_) report["ros2"] = ros2_->finish();
}

}  // namespace swiftlet
