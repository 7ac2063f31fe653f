#pragma once
// summary.json of a run: versions, input, settings, health history, counters, latency per stage, CPU time,
// memory and, if the log has truth, accuracy.
//
// Everything except "timing", "cpu" and "memory" is a function of log, settings and program: two runs give
// the same bytes there.

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/recorded/log_warnings.hpp"
#include "firmware_host/interfaces/run_listener.hpp"
#include "firmware_host/realtime/stage_timer.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// Resolution of "histogram" in a stage's timing: "from_ms count, from_ms count" for the non-empty columns,
/// shortest first.
inline constexpr int kHistogramColumnsPerDecade = 20;

struct MemoryRow {
  std::string what;
  std::int64_t bytes = 0;
};

struct RunFacts {
  std::string log;                    ///< empty: the run used devices
  std::string tracks;                 ///< file of feature tracks; empty when images were used
  std::uint64_t track_surplus = 0;    ///< landmarks omitted because a frame had more than kMaxFeatures
  std::vector<std::string> warnings;  ///< warnings about the input, as lines for the user
  std::string calibration_form;
  /// The input's counters, by name: {"log": {...}}.
  nlohmann::ordered_json input = nlohmann::ordered_json::object();
  bool mono = false;
  bool finished = true;  ///< false: stopped by the user
  double wall = 0;       ///< s, duration of the run including reading
  double cpu = 0;        ///< s, all threads
  std::int64_t peak_resident = 0;
  std::vector<MemoryRow> memory;
  /// How the run was executed: its kind, and for a threaded run its threads, rights, memory, arming,
  /// recording.
  nlohmann::ordered_json executor = nlohmann::ordered_json::object();
};

/// Without "accuracy", which the caller adds.
nlohmann::ordered_json summaryOf(const RunFacts& facts, const Settings& settings,
                                 const RunStatistics& statistics);

/// Shift from the images' clock, used by the run's poses, to the clock of IMU and truth: as estimated at the
/// run's end, or as calibrated. Zero if the summary does not contain it.
Duration cameraToImuShift(const nlohmann::ordered_json& summary);

nlohmann::ordered_json toJson(const LogCounters& log);
/// Report of full smoothing, for "full_smoothing" in the counters.
nlohmann::ordered_json toJson(const FullSmootherReport& map);
/// Latencies of the stages that did something, by stage name.
nlohmann::ordered_json timingJson(const StageTable& table);

/// Counters of the mesher, without those of the pipeline around it.
nlohmann::ordered_json toJson(const MeshCounters& stage, const HorizonCounters& horizon);
nlohmann::ordered_json toJson(const LoopCounters& loops);

/// The summary in a few lines for the terminal.
std::string summaryText(const nlohmann::ordered_json& summary);

/// Writes pretty-printed JSON; InputError when that fails.
void writeJson(const std::string& path, const nlohmann::ordered_json& json);

/// Version, compiler and build flags.
nlohmann::ordered_json versionJson();
std::string versionText();

}  // namespace swiftlet
