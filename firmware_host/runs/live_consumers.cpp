#include "firmware_host/runs/live_consumers.hpp"

#include <fmt/format.h>

#include <cmath>

#include "drivers/input/input_error.hpp"
#include "estimator/odometry/odometry_inputs.hpp"
#include "firmware_host/realtime/console.hpp"

namespace swiftlet {
namespace {

void checkAutopilot(const FlightRequest& request) {
  if (request.speed != 1) {
    throw InputError("--speed", 0, "", "an autopilot needs a flight at its own speed",
                     "Omit --speed, or leave autopilot.device empty");
  }
}

void checkLabels(const Settings& settings) {
  const std::string& topic = settings.ros2.label_topic;
  if (topic.front() != '/') {
    throw InputError("settings", 0, "ros2.label_topic", "'" + topic + "' is not a topic name",
                     "Start it with a slash, for example /segmentation/labels");
  }
  if (!settings.map.enabled || !settings.map_stage.labels) {
    throw InputError("settings", 0, "ros2.label_topic", "labels are stored in the map, but no map is built",
                     "Enable map.enabled and map.labels (--map), or leave ros2.label_topic empty");
  }
}

}  // namespace

LiveConsumers::LiveConsumers(const Calibration& calibration, const Settings& settings,
                             const FlightRequest& request) {
  if (!settings.autopilot.device.empty()) {
    checkAutopilot(request);
    AutopilotThreadOptions options;
    options.settings = settings.autopilot;
    options.outbox = request.autopilot_outbox;
    if (!request.host_stamps) options.to_host = request.to_host;
    options.priority = settings.realtime.enabled ? settings.realtime.mesh_priority : 0;
    autopilot_ = std::make_unique<AutopilotThread>(newOutlet(autopilot_outlet_), options);
  }
  if (settings.ros2.enabled) openRos2(calibration, settings, request);
  if (request.view) {
    LiveOutlet& outlet = newOutlet(view_outlet_);
    outlet.images = std::make_unique<ImageFeed>();
    view_ = std::make_unique<ViewThread>(outlet, *request.view, request.name,
                                         rigInUse(calibration.rig, settings.odometry));
    say(fmt::format("live view: {}\n", view_->url()));
  }
}

void LiveConsumers::openRos2(const Calibration& calibration, const Settings& settings,
                             const FlightRequest& request) {
  DdsThreadOptions options;
  options.settings = settings.ros2;
  if (request.host_stamps) options.clocks = readHostClocks;
  options.gyro_sigma = calibration.noise.gyro_density * std::sqrt(calibration.noise.rate_hz);
  if (!settings.ros2.label_topic.empty()) {
    checkLabels(settings);
    const CameraModel& camera = calibration.rig.camera[0];
    labels_ = std::make_unique<LabelExchange>(camera.width(), camera.height(),
                                              Duration::fromSeconds(settings.ros2.label_patience));
    options.labels = labels_.get();
  }
  ros2_ = std::make_unique<DdsThread>(newOutlet(ros2_outlet_), options);
}

LiveOutlet& LiveConsumers::newOutlet(std::unique_ptr<LiveOutlet>& owner) {
  owner = std::make_unique<LiveOutlet>();
  static_cast<void>(outlets_.tryPushBack(owner.get()));
  return *owner;
}

bool LiveConsumers::drainRemarks(RunObserver& observer) {
  return autopilot_ && autopilot_->drainEvents([&observer](Stamp stamp, const std::string& line) {
    observer.remark(stamp, line);
    warn(line + "\n");
  });
}

void LiveConsumers::addTo(Supervisor& supervisor) {
  for (const auto& [name, thread, follower] : followers()) {
    if (follower != nullptr) static_cast<void>(supervisor.add(thread, follower->heart()));
  }
  for (LiveOutlet* outlet : outlets_) {
    static_cast<void>(
        supervisor.addSink([outlet](const Verdict& verdict) { outlet->verdict.write(verdict); }));
  }
}

bool LiveConsumers::finish(nlohmann::ordered_json& report, std::vector<std::string>& faults) {
  for (const Named& each : followers()) {
    if (each.follower != nullptr) each.follower->tellEnd();
  }
  bool sound = true;
  for (const auto& [name, thread, follower] : followers()) {
    if (follower == nullptr) continue;
    report[name] = follower->finish();
    if (!report[name].contains("fault")) continue;
    faults.push_back(std::string(name) + ": " + report[name]["fault"].get<std::string>());
    if (report[name].size() == 1) sound = false;  // only the fault: the thread is stuck
  }
  return sound;
}

}  // namespace swiftlet
