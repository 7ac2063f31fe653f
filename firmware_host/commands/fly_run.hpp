#pragma once
// A live run as a function: vehicle settings in, run folder and summary out. What `swiftlet fly` calls.

#include <atomic>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "firmware_host/settings/settings.hpp"
#include "firmware_host/view/view_address.hpp"

namespace swiftlet {

struct FlyRequest {
  std::string out;
  bool imu_rate = false;
  bool loop_closure = false;        ///< sets loop.enabled
  bool map = false;                 ///< sets map.enabled
  bool record = false;              ///< write `recording/` into the run folder
  std::optional<ViewAddress> view;  ///< serve the live view there
  double seconds = 0;               ///< end after this long; 0: when told to
  const std::atomic<bool>* stop = nullptr;
  std::atomic<bool>* hung_up = nullptr;  ///< set: the terminal has closed; noted as an event, and cleared
  bool show_progress = false;
};

struct FlyResult {
  nlohmann::ordered_json summary;  ///< as written to summary.json
  bool has_pose = false;
  std::vector<std::string> missing;  ///< devices that did not open, in words; nothing was flown then
};

/// InputError for bad settings or calibration.
FlyResult runFlight(const FlyRequest& request, Settings settings);

/// The rig's calibration as the vehicle's settings name it; InputError naming the setting where they do not.
Calibration vehicleCalibration(const Settings& settings);

}  // namespace swiftlet
