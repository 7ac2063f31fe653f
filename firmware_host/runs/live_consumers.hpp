#pragma once
// Consumers that follow a run, each on its own thread: an autopilot, ROS 2 topics and their labels, the live
// view. Opened before the graph is built, ended after the executor. Only for real-time executors.

#include <array>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "firmware_host/interfaces/label_exchange.hpp"
#include "firmware_host/interfaces/live_outlet.hpp"
#include "firmware_host/outputs/autopilot/autopilot_thread.hpp"
#include "firmware_host/outputs/ros2/dds_thread.hpp"
#include "firmware_host/outputs/view/view_thread.hpp"
#include "firmware_host/runs/fly_threaded.hpp"
#include "firmware_host/supervisor/supervisor.hpp"

namespace swiftlet {

class LiveConsumers {
 public:
  /// Opens the consumers that settings and request enable. InputError naming the option if one does not open.
  LiveConsumers(const Calibration& calibration, const Settings& settings, const FlightRequest& request);

  /// For GraphOptions; valid as long as this object.
  [[nodiscard]] const LiveOutlets& outlets() const { return outlets_; }
  /// For GraphOptions, like outlets(); null if no labels are received.
  [[nodiscard]] LabelExchange* labels() const { return labels_.get(); }
  /// Writes the consumers' messages since the last call to the log. True: there were some.
  bool drainRemarks(RunObserver& observer);
  /// Call before the supervisor's begin(): adds the consumers to it and gives them its verdicts.
  void addTo(Supervisor& supervisor);
  /// Ends them. `report` receives each consumer's counters under its name, `faults` the reason if one ended
  /// early. Returns false if one may be stuck; it then uses its outlet forever.
  bool finish(nlohmann::ordered_json& report, std::vector<std::string>& faults);

 private:
  void openRos2(const Calibration& calibration, const Settings& settings, const FlightRequest& request);
  LiveOutlet& newOutlet(std::unique_ptr<LiveOutlet>& owner);
  struct Named {
    const char* name;    ///< name in the summary
    const char* thread;  ///< name for the supervisor
    Follower* follower;  ///< null: there is none
  };
  [[nodiscard]] std::array<Named, 3> followers() const {
    return {{{"autopilot", "autopilot", autopilot_.get()},
             {"ros2", "dds", ros2_.get()},
             {"view", "view", view_.get()}}};
  }

  LiveOutlets outlets_;
  std::unique_ptr<LiveOutlet> autopilot_outlet_;
  std::unique_ptr<AutopilotThread> autopilot_;
  std::unique_ptr<LiveOutlet> ros2_outlet_;
  std::unique_ptr<LabelExchange> labels_;
  std::unique_ptr<DdsThread> ros2_;
  std::unique_ptr<LiveOutlet> view_outlet_;
  std::unique_ptr<ViewThread> view_;
};

}  // namespace swiftlet
