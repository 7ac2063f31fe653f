#pragma once
// A replay as a function: log and settings in, run folder and summary out. Called by `swiftlet replay` and by
// the tests on whole logs.

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "firmware_host/inputs/log/log_request.hpp"
#include "firmware_host/interfaces/run_listener.hpp"
#include "firmware_host/outputs/view/view_address.hpp"
#include "firmware_host/runs/kept_map_request.hpp"
#include "firmware_host/supervisor/verdict.hpp"

namespace swiftlet {

/// Compares the trajectories of a run folder with the truth, for the summary.
using AccuracyOfRun = std::function<nlohmann::ordered_json(const std::string& folder, const Trajectory& truth,
                                                           const std::string& truth_name, Stamp first_image,
                                                           const EvaluationGroup& settings)>;

struct ReplayRequest : LogRequest {
  std::string out;
  bool replace = false;  ///< also replace files in `out` of a flight or of no run
  std::string tracks;    ///< feature tracks that replace the log's images or own tracks
  bool imu_rate = false;
  bool mesh_sequence = false;  ///< write the meshes of all frames to `meshes/`
  bool loop_closure = false;   ///< recognize places; sets loop.enabled
  KeptMapRequest kept_maps;
  bool map = false;                 ///< fuse depth into a map; sets map.enabled
  bool real_time = false;           ///< run on threads, with messages played at their times
  double speed = 1;                 ///< with real_time: factor relative to recorded time
  std::optional<ViewAddress> view;  ///< with real_time: serve the live view at this address
  bool record = false;              ///< write `recording/` into the run folder
  bool reproduce = false;  ///< `log` is a recording: repeat its threaded run step by step, with its settings
  bool inspect = false;    ///< look for mistakes in units, axes and clocks first (inspection/inspect_log.hpp)
  AccuracyOfRun accuracy;  ///< for a log with truth (lab/evaluation/evaluate_run.hpp); empty: not computed
};

/// Hooks for tests, for example to slow stages down.
struct ReplayHooks {
  std::function<void(StageId, double)> drag;
  std::function<bool(const char* node)> before_turn;  ///< ThreadedOptions::before_turn
  std::function<void(const Verdict&)> verdict;        ///< FlightRequest::verdict
};

struct ReplayResult {
  nlohmann::ordered_json summary;  ///< as written to summary.json
  bool finished = true;            ///< false: stopped on request, or a thread ended early
  bool left_behind = false;        ///< a thread was stuck at the end; its memory is kept
  bool has_pose = false;
  std::string lost;  ///< the first file that was not completely written; empty: none
  RunStatistics statistics;
};

/// Creates the run folder and everything in it. InputError for bad input, and if `out` may not be written to.
ReplayResult runReplay(const ReplayRequest& request, Settings settings, const ReplayHooks& hooks = {});

}  // namespace swiftlet
