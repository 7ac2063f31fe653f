#pragma once
// summary.json of a run: versions, input, settings, health history, counters, latency per stage, CPU
// time, memory and, when the log has truth, accuracy.
//
// Everything but "timing", "cpu" and "memory" is a function of log, settings and program: two runs give
// the same bytes there.

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/recorded/log_warnings.hpp"
#include "firmware_host/interfaces/run_listener.hpp"
#include "firmware_host/realtime/stage_timer.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// Of "histogram" in the timing of a stage: "from_ms count, from_ms count" of the columns that hold
/// something, from the shortest on.
inline constexpr int kHistogramColumnsPerDecade = 20;

struct MemoryRow {
  std::string what;
  std::int64_t bytes = 0;
};

struct RunFacts {
  std::string log;                    ///< empty: flown on devices
  std::string tracks;                 ///< file of feature tracks; empty when images were used
  std::uint64_t track_surplus = 0;    ///< landmarks beyond kMaxFeatures in a frame, left out
  std::vector<std::string> warnings;  ///< lines for the user, of the input
  std::string calibration_form;
  /// What the input counted, by its name in the summary's counters: {"log": {...}}.
  nlohmann::ordered_json input = nlohmann::ordered_json::object();
  bool mono = false;
  bool finished = true;  ///< false: stopped by the user
  double wall = 0;       ///< s of the run, reading included
  double cpu = 0;        ///< s, all threads
  std::int64_t peak_resident = 0;
  std::vector<MemoryRow> memory;
  /// How the run was executed: its kind, and of a threaded one threads, rights, memory, arming, recording.
  nlohmann::ordered_json executor = nlohmann::ordered_json::object();
};

/// Without accuracy: the caller adds it under "accuracy".
nlohmann::ordered_json summaryOf(const RunFacts& facts, const Settings& settings,
                                 const RunStatistics& statistics);

/// From the images' clock, which the poses of a run have, to that of the IMU and the truth: as estimated at
/// the run's end, or as calibrated. Zero where a summary does not say.
Duration cameraToImuShift(const nlohmann::ordered_json& summary);

nlohmann::ordered_json toJson(const LogCounters& log);
/// Of full smoothing, under "full_smoothing" in the counters.
nlohmann::ordered_json toJson(const FullSmootherReport& map);
/// Latencies of the stages that did something, by their names.
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
