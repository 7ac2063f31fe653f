#pragma once
// Who follows a run while it goes on, each from a thread of its own: an autopilot, ROS 2's topics and labels
// by them, the live view. Opened before the graph is built, ended after the executor. An executor that is
// not real-time has none.

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
  /// Opens those that settings and request switch on. InputError naming the option where one does not open.
  LiveConsumers(const Calibration& calibration, const Settings& settings, const FlightRequest& request);

  /// For GraphOptions; they live as long as this.
  [[nodiscard]] const LiveOutlets& outlets() const { return outlets_; }
  /// Likewise; null where nobody brings labels.
  [[nodiscard]] LabelExchange* labels() const { return labels_.get(); }
  /// What they have to say of themselves since the last call, to the log. True: there was something.
  bool drainRemarks(RunObserver& observer);
  /// Before its begin(): puts them under supervision, and lets them have its verdicts.
  void addTo(Supervisor& supervisor);
  /// Ends them; `report` gets what each counted under its own name, `faults` what ended one before its time.
  /// False: one may be stuck, and uses its outlet for good.
  bool finish(nlohmann::ordered_json& report, std::vector<std::string>& faults);

 private:
  void openRos2(const Calibration& calibration, const Settings& settings, const FlightRequest& request);
  LiveOutlet& newOutlet(std::unique_ptr<LiveOutlet>& owner);
  struct Named {
    const char* name;    ///< in the summary
    const char* thread;  ///< to the supervisor
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
