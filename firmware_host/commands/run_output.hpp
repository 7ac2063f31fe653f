#pragma once
// The run folder while a run writes it, whatever the run is fed by: what its threads log into, the recorder,
// and at the end the trajectory of the map, the loops and the summary.

#include <filesystem>
#include <memory>
#include <string>

#include "drivers/calibration/calibration.hpp"
#include "drivers/recorded/recording_header.hpp"
#include "firmware_host/pipeline/flight_recorder.hpp"
#include "firmware_host/pipeline/wiring.hpp"
#include "firmware_host/report/memory_use.hpp"
#include "firmware_host/report/run_recorder.hpp"
#include "firmware_host/report/summary.hpp"

namespace swiftlet {

class RunOutput {
 public:
  struct Wanted {
    bool imu_rate = false;       ///< imu_rate.tum
    bool mesh_sequence = false;  ///< meshes/
  };

  /// Creates the folder. InputError where that fails. Settings and calibration outlive it.
  RunOutput(const std::string& out, const Settings& settings, const Calibration& calibration, Wanted wanted);

  [[nodiscard]] RunLog& log() { return log_; }
  /// Of loop closure: null is the shipped one.
  [[nodiscard]] const Vocabulary* vocabulary();
  /// What the wiring is to know of this folder.
  [[nodiscard]] Wiring::Options wiringOptions();
  /// Writes `recording/`.
  [[nodiscard]] std::unique_ptr<FlightRecorder> startRecorder(RecordOrder order) const;

  /// After the run: map.tum, loops.csv, and what is to be the summary. Fills the facts' peak of memory.
  nlohmann::ordered_json finish(RunFacts& facts);
  void writeSummary(const nlohmann::ordered_json& summary) const;

 private:
  std::filesystem::path out_;
  const Settings& settings_;
  const Calibration& calibration_;
  Wanted wanted_;
  std::unique_ptr<const Vocabulary> vocabulary_;
  RunRecorder recorder_;
  RunLog log_;
};

/// Memory as it grew: what each part made resident.
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

/// Of the summary.
nlohmann::ordered_json recordingJson(const FlightRecorder& recorder);

}  // namespace swiftlet
