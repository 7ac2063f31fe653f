#pragma once
// A live run as a function: vehicle settings in, run folder and summary out. What `swiftlet fly` calls.

#include <atomic>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "firmware_host/outputs/view/view_address.hpp"
#include "firmware_host/runs/kept_map_request.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

struct FlyRequest {
  std::string out;       ///< empty: a new folder in flights.folder
  bool replace = false;  ///< a run in `out` may be replaced
  bool imu_rate = false;
  bool loop_closure = false;  ///< sets loop.enabled
  KeptMapRequest kept_maps;
  bool map = false;                 ///< sets map.enabled
  bool record = false;              ///< write `recording/` into the run folder
  std::optional<ViewAddress> view;  ///< serve the live view there
  double seconds = 0;               ///< end after this long; 0: when told to
  const std::atomic<bool>* stop = nullptr;
  std::atomic<bool>* hung_up = nullptr;  ///< set: the terminal has closed; noted as an event, and cleared
  /// After the flight, before full smoothing (flights.smooth): what ends that, since `stop` ended the flight.
  std::function<const std::atomic<bool>*()> renew_stop;
  bool show_progress = false;
};

struct FlyResult {
  nlohmann::ordered_json summary;  ///< as written to summary.json
  std::string out;                 ///< the run folder; empty: it could not be made
  std::string lost;                ///< the first file that could not be written; empty: all were
  bool faultless = true;           ///< false: a thread ended before its time; the summary says which
  bool left_behind = false;        ///< a thread was stuck at the end, and what it uses stays in memory
  bool has_pose = false;
  std::vector<std::string> missing;  ///< devices that did not open, in words; nothing was flown then
};

/// InputError for bad settings or calibration, and where `out` holds a run. No disk ends or prevents a
/// flight: what cannot be written is left out and told.
FlyResult runFlight(const FlyRequest& request, Settings settings);

}  // namespace swiftlet
