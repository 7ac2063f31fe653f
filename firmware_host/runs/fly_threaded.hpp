#pragma once
// A run on threads with all that belongs around it: memory reserved, shown and locked, libraries confined,
// what the machine says, effort governed by the budgets, those who follow the run, and the supervisor of them
// all.

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "drivers/calibration/calibration.hpp"
#include "firmware_host/graph/graph.hpp"
#include "firmware_host/interfaces/link_outbox.hpp"
#include "firmware_host/outputs/view/view_address.hpp"
#include "firmware_host/schedule/threaded.hpp"

namespace swiftlet {

struct FlightRequest {
  double speed = 1;          ///< of the log's clock against the host's
  bool host_stamps = false;  ///< of CLOCK_MONOTONIC, not of a log
  /// From a log's stamps to CLOCK_MONOTONIC; gives none while that is not known. Any thread.
  std::function<std::optional<Duration>()> to_host;
  bool announce = false;  ///< print the table of what was reserved, and what is missing
  bool trigger = false;   ///< a separate line reports edges (SensorInput::look)
  bool record = false;    ///< the flight is to be recorded
  bool service = false;   ///< notify systemd if it requests it
  std::string name;       ///< what is flown, for those who look on
  /// Outbox of the IMU's link if the autopilot shares it; null: the autopilot has its own port. It outlives
  /// the run.
  LinkOutbox* autopilot_outbox = nullptr;
  std::optional<ViewAddress> view;  ///< serve the live view there
  /// What is wrong with the run's files; null: nothing. Any thread.
  std::function<const char*()> file_problem;
  std::function<bool(const char* node)> before_turn;  ///< ThreadedOptions::before_turn
  std::function<void(const Verdict&)> verdict;        ///< on the supervisor's thread; for tests
};

struct FlightEnd {
  bool finished = true;      ///< false: stopped
  bool faultless = true;     ///< no thread ended before its time
  bool left_behind = false;  ///< a thread is stuck: what it uses must stay (ThreadedReport::left_behind)
};

/// `report` gets what the summary says of the executor.
FlightEnd flyThreaded(const Calibration& calibration, SensorInput& input, const Settings& settings,
                      RunObserver& observer, GraphOptions wanted, const FlightRequest& request,
                      const RunControl& control, nlohmann::ordered_json& report);

}  // namespace swiftlet
