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
  double seconds = 0;               ///< stop after this long; 0: only on request
  const std::atomic<bool>* stop = nullptr;
  std::atomic<bool>* hung_up = nullptr;  ///< set: the terminal has closed; noted as an event, and cleared
  /// After the flight, before full smoothing (flights.smooth): returns the flag that stops smoothing, since
  /// `stop` ended the flight.
  std::function<const std::atomic<bool>*()> renew_stop;
  bool show_progress = false;
};

struct FlyResult {
  nlohmann::ordered_json summary;  ///< as written to summary.json
  std::string out;                 ///< the run folder; empty: it could not be created
  std::string lost;                ///< the first file that could not be written; empty: all were
  bool faultless = true;           ///< false: a thread ended early; see the summary
  bool left_behind = false;        ///< a thread was stuck at the end; its memory is kept
  bool has_pose = false;
  std::vector<std::string> missing;  ///< devices that did not open, as text; no flight took place then
};

/// InputError for bad settings or calibration, and if `out` holds a run. A disk error neither ends nor
/// prevents a flight: files that cannot be written are skipped and reported.
FlyResult runFlight(const FlyRequest& request, Settings settings);

}  // namespace swiftlet
