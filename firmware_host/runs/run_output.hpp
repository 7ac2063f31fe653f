#pragma once
// The run folder during a run with any kind of input: log files of the threads, the recorder, and at the end
// the loops, the summary and the map's smoothed trajectory.
//
// With Wanted::fly_on, disk errors do not end the run: lost() lists what could not be written, and the run
// continues. Otherwise InputError if a file cannot be created.

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "drivers/calibration/calibration.hpp"
#include "drivers/recorded/recording_header.hpp"
#include "firmware_host/graph/flight_recorder.hpp"
#include "firmware_host/graph/graph.hpp"
#include "firmware_host/outputs/run_folder/run_recorder.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "firmware_host/realtime/memory_use.hpp"
#include "mapping/volume/confusion_model.hpp"

namespace swiftlet {

/// Files read before a run.
struct RunInputs {
  std::unique_ptr<const Vocabulary> vocabulary;  ///< null: the shipped one
  std::unique_ptr<const KeptGraph> kept_map;     ///< map in which the run is located; null: none
  std::string kept_volume;                       ///< checked file of its volume; empty: none, or no map
  std::optional<ConfusionModel> confusion;       ///< map.confusion; empty: none, or no map
};

/// Call before the run's folder is claimed: a claim deletes the earlier run in it. InputError if a file is
/// refused, or if the folder `keep_map` exists (empty: no map is kept).
[[nodiscard]] RunInputs readRunInputs(const Settings& settings, const std::string& keep_map);

class RunOutput {
 public:
  struct Wanted {
    bool imu_rate = false;       ///< imu_rate.tum
    bool mesh_sequence = false;  ///< meshes/
    std::string keep_map = "";   ///< folder; empty: no map is kept
    bool fly_on = false;         ///< continue without files that cannot be written
  };

  /// `out` exists and is claimed by the run (run_claim.hpp); empty: there is no folder, and nothing is
  /// written. Settings, calibration and `lost` outlive this object.
  RunOutput(const std::string& out, const Settings& settings, const Calibration& calibration, Wanted wanted,
            RunInputs inputs, LostFiles& lost);

  [[nodiscard]] RunObserver& observer() { return observer_; }
  /// Graph options that depend on this folder.
  [[nodiscard]] GraphOptions graphOptions();
  /// Writes `recording/`. `depth_sensor`: the map's; null: none. Returns null if it cannot be written
  /// (fly_on).
  [[nodiscard]] std::unique_ptr<FlightRecorder> startRecorder(
      RecordOrder order, const DepthImageView* depth_sensor = nullptr) const;

  /// After the run: writes loops.csv and, if there is one, the estimated calibration to
  /// estimated_calibration/; closes the keyframe file; writes map.tum from the pose graph if there is one.
  /// Sets the facts' peak memory.
  void close(RunFacts& facts);
  /// Whether smooth() has something to do.
  [[nodiscard]] bool canSmooth() const { return keeps_keyframes_; }
  /// After close() and after the summary was written: smooths all keyframes together and writes map.tum.
  /// `stop` ends it without map.tum.
  void smooth(const std::atomic<bool>* stop, bool announce);

  /// The summary so far.
  [[nodiscard]] nlohmann::ordered_json summary(const RunFacts& facts);
  void writeSummary(const nlohmann::ordered_json& summary) const;

 private:
  template <typename Write>
  void attempt(const Write& write) const;
  void writeCalibration();

  std::filesystem::path out_;
  const Settings& settings_;
  const Calibration& calibration_;
  Wanted wanted_;
  LostFiles& lost_;
  bool keeps_keyframes_ = false;
  RunInputs inputs_;
  RunRecorder recorder_;
  RunObserver observer_;
};

/// Resident memory added by each part.
class MemoryTrack {
 public:
  MemoryTrack() : last_(residentBytes()) { rows_.push_back({"program_at_start", last_}); }
  void note(const std::string& what) {
    const std::int64_t now = residentBytes();
    rows_.push_back({what, now - last_});
    last_ = now;
  }
  [[nodiscard]] const std::vector<MemoryRow>& rows() const { return rows_; }

 private:
  std::vector<MemoryRow> rows_;
  std::int64_t last_;
};

/// For the summary.
nlohmann::ordered_json recordingJson(const FlightRecorder& recorder);

}  // namespace swiftlet
