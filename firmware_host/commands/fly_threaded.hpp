#pragma once
// A run on threads with all that belongs around it: memory reserved, shown and locked, libraries confined,
// what the machine says, effort governed by the budgets, and whether the vehicle might be armed.

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "drivers/calibration/calibration.hpp"
#include "firmware_host/pipeline/threaded.hpp"
#include "firmware_host/pipeline/wiring.hpp"
#include "firmware_host/view/view_address.hpp"

namespace swiftlet {

struct FlightRequest {
  double speed = 1;          ///< of the log's clock against the host's
  bool host_stamps = false;  ///< of CLOCK_MONOTONIC, not of a log
  /// From a log's stamps to CLOCK_MONOTONIC; gives none while that is not known. Any thread.
  std::function<std::optional<Duration>()> to_host;
  bool announce = false;            ///< print the table of what was reserved, and what is missing
  std::string name;                 ///< what is flown, for those who look on
  std::optional<ViewAddress> view;  ///< serve the live view there
};

/// `report` gets what the summary says of the executor. False when it was stopped.
bool flyThreaded(const Calibration& calibration, SensorInput& input, const Settings& settings, RunLog& log,
                 Wiring::Options wanted, const FlightRequest& request, const RunControl& control,
                 nlohmann::ordered_json& report);

}  // namespace swiftlet
