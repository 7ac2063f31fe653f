#pragma once
// A threaded run with its environment: memory is reserved, reported and locked, libraries are confined, the
// machine is inspected, budgets govern the effort, and consumers and supervisor run.

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
  double speed = 1;          ///< speed of the log's clock relative to the host's
  bool host_stamps = false;  ///< stamps are of CLOCK_MONOTONIC, not of a log
  /// Any thread: offset from the log's stamps to CLOCK_MONOTONIC; empty while unknown.
  std::function<std::optional<Duration>()> to_host;
  bool announce = false;  ///< print the table of reserved and missing resources
  bool trigger = false;   ///< trigger edges are reported separately (SensorInput::look)
  bool record = false;    ///< the flight is to be recorded
  bool service = false;   ///< notify systemd if it has requested it
  std::string name;       ///< name of the flight for viewers
  /// Outbox of the IMU's link, if the autopilot shares that link; null: the autopilot has its own port.
  /// Outlives the run.
  LinkOutbox* autopilot_outbox = nullptr;
  std::optional<ViewAddress> view;  ///< serve the live view at this address
  /// Any thread: what is wrong with the run's files; null: nothing.
  std::function<const char*()> file_problem;
  std::function<bool(const char* node)> before_turn;  ///< ThreadedOptions::before_turn
  std::function<void(const Verdict&)> verdict;        ///< called on the supervisor's thread; for tests
};

struct FlightEnd {
  bool finished = true;      ///< false: stopped on request
  bool faultless = true;     ///< no thread ended early
  bool left_behind = false;  ///< a thread is stuck: its memory must stay (ThreadedReport::left_behind)
};

/// `report` receives the executor's part of the summary.
FlightEnd flyThreaded(const Calibration& calibration, SensorInput& input, const Settings& settings,
                      RunObserver& observer, GraphOptions wanted, const FlightRequest& request,
                      const RunControl& control, nlohmann::ordered_json& report);

}  // namespace swiftlet
