#pragma once
// A live run as a function: vehicle settings in, run folder and summary out. Called by `swiftlet fly`.

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
  std::optional<ViewAddress> view;  ///< serve the live view at this address
  double seconds = 0;               ///< stop after this long; 0: only on request
  const std::atomic<bool>* stop = nullptr;
  std::atomic<bool>* hung_up = nullptr;  ///< set when the terminal has closed: noted as an event and cleared
  /// Called after the flight, before full smoothing (flights.smooth). Returns the flag that stops smoothing,
  /// because `stop` has already ended the flight.
  std::function<const std::atomic<bool>*()> renew_stop;
  bool show_progress = false;
};

struct FlyResult {
  nlohmann::ordered_json summary;  ///< as written to summary.json
  std::string out;                 ///< the run folder; empty: it could not be created
  std::string lost;                ///< the first file that could not be written; empty: none
  bool faultless = true;           ///< false: a thread ended early; see the summary
  bool left_behind = false;        ///< a thread was stuck at the end; its memory is kept
  bool has_pose = false;
  std::vector<std::string> missing;  ///< devices that did not open, as text; then no flight took place
};

/// InputError for bad settings or calibration, and if `out` holds a run. A disk error neither ends nor
/// prevents a flight: files that cannot be written are skipped and reported.
FlyResult runFlight(const FlyRequest& request, Settings settings);

}  // namespace swiftlet
