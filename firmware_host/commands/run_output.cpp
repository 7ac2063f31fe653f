#include "firmware_host/commands/run_output.hpp"

#include "drivers/recorded/trajectory_file.hpp"
#include "firmware_host/places/vocabulary_file.hpp"
#include "firmware_host/report/loops_csv.hpp"
#include "firmware_host/report/whole_file.hpp"
#include "firmware_host/settings/read_settings.hpp"

namespace swiftlet {
namespace {

void writeMap(const std::string& path, const std::vector<MapPose>& poses) {
  if (poses.empty()) return;
  WholeFile file(path);
  for (const MapPose& pose : poses) file.write(formatTum(pose.stamp, pose.T_world_body) + "\n");
  file.commit();
}

}  // namespace

RunOutput::RunOutput(const std::string& out, const Settings& settings, const Calibration& calibration,
                     Wanted wanted)
    : out_(out),
      settings_(settings),
      calibration_(calibration),
      wanted_(wanted),
      recorder_(out, wanted.imu_rate, wanted.mesh_sequence),
      log_(recorder_) {
  writeWholeFile(out_ / "settings.yaml", printSettings(settings_, false) + "\n");
  if (settings_.full_smoothing) {
    log_.keepForMap(std::make_unique<MapKeeper>(out, calibration.rig, calibration.noise, settings_.odometry));
  }
}

const Vocabulary* RunOutput::vocabulary() {
  const std::string& file = settings_.loop.vocabulary;
  if (!settings_.loop.enabled || file.empty()) return nullptr;
  if (!vocabulary_) vocabulary_ = std::make_unique<const Vocabulary>(readVocabulary(file));
  return vocabulary_.get();
}

Wiring::Options RunOutput::wiringOptions() {
  Wiring::Options options;
  options.imu_states = wanted_.imu_rate;
  options.meshes = wanted_.mesh_sequence;
  options.vocabulary = vocabulary();
  options.spill = &recorder_.spilled();
  return options;
}

std::unique_ptr<FlightRecorder> RunOutput::startRecorder(RecordOrder order) const {
  RecordingHeader header;
  header.rig = calibration_.rig;
  header.noise = calibration_.noise;
  header.calibration_form = calibration_.form;
  header.settings = printSettings(settings_, false);
  header.program_version = versionText();
  header.order = order;
  return std::make_unique<FlightRecorder>((out_ / "recording").string(), header);
}

nlohmann::ordered_json RunOutput::finish(RunFacts& facts) {
  facts.peak_resident = peakResidentBytes();
  writeMap(out_ / "map.tum", log_.solveMap());
  if (settings_.loop.enabled) writeLoops(out_ / "loops.csv", log_.loops());
  const RunStatistics& statistics = log_.statistics();
  nlohmann::ordered_json summary = summaryOf(facts, settings_, statistics);
  if (!recorder_.map().is_null()) {
    summary["map"] = recorder_.map();
    const MapThreadStatistics& mapping = *statistics.mapping;
    summary["map"]["frames"] = {{"to_map", mapping.frames},
                                {"without_image", mapping.without_image},
                                {"without_scene", mapping.without_scene},
                                {"refused", mapping.refused}};
    if (mapping.held) {
      summary["map"]["labels_in"] = {{"in_time", mapping.held->labelled},
                                     {"late", mapping.held->late},
                                     {"no_room", mapping.held->no_room},
                                     {"nobody_there", mapping.held->nobody},
                                     {"longest_wait_ms", mapping.held->longest_ms}};
    }
  }
  return summary;
}

void RunOutput::writeSummary(const nlohmann::ordered_json& summary) const {
  writeJson(out_ / "summary.json", summary);
}

nlohmann::ordered_json recordingJson(const FlightRecorder& recorder) {
  const RecordingStatistics& statistics = recorder.statistics();
  nlohmann::ordered_json lost = nlohmann::ordered_json::object();
  for (std::size_t kind = 0; kind < kRecordKinds; ++kind) {
    if (statistics.lost[kind] > 0) lost[pluralName(static_cast<RecordKind>(kind))] = statistics.lost[kind];
  }
  return {{"records", statistics.records},
          {"bytes", statistics.bytes},
          {"segments", statistics.segments},
          {"syncs", statistics.syncs},
          {"lost", lost},
          {"error", recorder.status().ok() ? "" : recorder.status().what}};
}

}  // namespace swiftlet
