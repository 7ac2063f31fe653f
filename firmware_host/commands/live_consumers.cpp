#include "firmware_host/commands/live_consumers.hpp"

#include <fmt/format.h>

#include <cstdio>

#include "drivers/calibration/input_error.hpp"

namespace swiftlet {

LiveConsumers::LiveConsumers(const Settings& settings, const FlightRequest& request) {
  if (!settings.autopilot.device.empty()) {
    if (settings.autopilot.device == settings.imu_link.device) {
      throw InputError("settings", 0, "autopilot.device", settings.autopilot.device + " is the IMU's port",
                       "Give the autopilot a port of its own, or UDP");
    }
    if (request.speed != 1) {
      throw InputError("--speed", 0, "", "an autopilot is told of a flight at its own speed",
                       "Leave --speed out, or autopilot.device empty");
    }
    const RealtimeGroup& realtime = settings.realtime;
    autopilot_ = std::make_unique<AutopilotThread>(
        newOutlet(autopilot_outlet_), AutopilotThreadOptions{settings.autopilot, request.host_stamps,
                                                             realtime.enabled ? realtime.mesh_priority : 0});
  }
  if (settings.ros2.enabled) {
    ros2_ = std::make_unique<DdsThread>(
        newOutlet(ros2_outlet_),
        DdsThreadOptions{settings.ros2, request.host_stamps ? realtimeOffset() : Duration{0}});
  }
  if (request.view) {
    view_ = std::make_unique<ViewThread>(newOutlet(view_outlet_), *request.view, request.name);
    fmt::print("live view: {}\n", view_->url());
    std::fflush(stdout);  // who reads through a pipe wants to look now
  }
}

LiveOutlet& LiveConsumers::newOutlet(std::unique_ptr<LiveOutlet>& owner) {
  owner = std::make_unique<LiveOutlet>();
  static_cast<void>(outlets_.tryPushBack(owner.get()));
  return *owner;
}

bool LiveConsumers::drainRemarks(RunLog& log) {
  return autopilot_ && autopilot_->drainEvents([&log](Stamp stamp, const std::string& line) {
    log.remark(stamp, line);
    fmt::print(stderr, "{}\n", line);
  });
}

void LiveConsumers::finish(nlohmann::ordered_json& report) {
  if (autopilot_) report["autopilot"] = autopilot_->finish();
  if (ros2_) report["ros2"] = ros2_->finish();
  if (view_) report["view"] = view_->finish();
}

}  // namespace swiftlet
