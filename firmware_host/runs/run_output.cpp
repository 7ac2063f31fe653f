#include "firmware_host/runs/run_output.hpp"

#include <fmt/format.h>

#include "drivers/input/input_error.hpp"
#include "firmware_host/files/new_folder.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/inputs/vocabulary/vocabulary_file.hpp"
#include "firmware_host/outputs/map_files/kept_folder.hpp"
#include "firmware_host/outputs/map_files/kept_map.hpp"
#include "firmware_host/outputs/run_folder/calibration_files.hpp"
#include "firmware_host/outputs/run_folder/loops_csv.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/runs/smooth_run.hpp"
#include "firmware_host/settings/confusion_file.hpp"
#include "firmware_host/settings/read_settings.hpp"

namespace swiftlet {

RunInputs readRunInputs(const Settings& settings, const std::string& keep_map) {
  RunInputs inputs;
  const std::string& vocabulary = settings.loop.vocabulary;
  if (settings.loop.enabled && !vocabulary.empty()) {
    inputs.vocabulary = std::make_unique<const Vocabulary>(readVocabulary(vocabulary));
  }
  if (!settings.loop.in_map.empty()) {
    inputs.kept_map = std::make_unique<const KeptGraph>(readKeptFolder(settings.loop.in_map));
  }
  if (settings.map.enabled) {
    inputs.confusion = confusionOf(settings);
    const std::string volume = keptVolumeOf(settings.loop.in_map);
    if (inputs.kept_map && std::filesystem::exists(volume)) {
      checkKeptMapFile(volume, volumeSettings(settings.map_stage));
      inputs.kept_volume = volume;
    }
  }
  if (!keep_map.empty()) refuseExisting(keep_map);
  return inputs;
}

template <typename Write>
void RunOutput::attempt(const Write& write) const {
  if (!wanted_.fly_on) {
    write();
    return;
  }
  if (out_.empty()) return;
  try {
    write();
  } catch (const InputError& error) {
    lost_.add(error.what());
  }
}

RunOutput::RunOutput(const std::string& out, const Settings& settings, const Calibration& calibration,
                     Wanted wanted, RunInputs inputs, LostFiles& lost)
    : out_(out),
      settings_(settings),
      calibration_(calibration),
      wanted_(wanted),
      lost_(lost),
      inputs_(std::move(inputs)),
      recorder_(out,
                {wanted.imu_rate, wanted.mesh_sequence, inputs_.kept_map != nullptr, wanted.keep_map,
                 wanted.fly_on},
                lost),
      observer_(recorder_) {
  if (inputs_.kept_map) observer_.awaitLocation(inputs_.kept_map->nodes.size());
  attempt([&] { writeWholeFile(out_ / "settings.yaml", printSettings(settings_, false) + "\n"); });
  if (!settings_.full_smoothing) return;
  attempt([&] {
    observer_.keepForMap(
        std::make_unique<MapKeeper>(out, calibration.rig, calibration.noise, settings_.odometry, lost));
    keeps_keyframes_ = true;
  });
}

GraphOptions RunOutput::graphOptions() {
  GraphOptions options;
  options.imu_states = wanted_.imu_rate;
  options.meshes = wanted_.mesh_sequence;
  options.vocabulary = inputs_.vocabulary.get();
  options.kept_map = inputs_.kept_map.get();
  options.confusion = inputs_.confusion;
  options.storage = &recorder_.storage();
  if (!inputs_.kept_volume.empty()) {
    options.kept_volume = [volume = inputs_.kept_volume](MapSubmaps& to, std::span<const WorldInMap> nodes) {
      readKeptSubmaps(volume, to, nodes);
    };
  }
  return options;
}

std::unique_ptr<FlightRecorder> RunOutput::startRecorder(RecordOrder order,
                                                         const DepthImageView* depth_sensor) const {
  RecordingHeader header;
  header.rig = calibration_.rig;
  header.noise = calibration_.noise;
  header.calibration_form = calibration_.form;
  header.settings = printSettings(settings_, false);
  header.program_version = versionText();
  header.order = order;
  if (depth_sensor != nullptr) header.depth_sensor = *depth_sensor;
  std::unique_ptr<FlightRecorder> recorder;
  attempt([&] { recorder = std::make_unique<FlightRecorder>((out_ / "recording").string(), header); });
  return recorder;
}

void RunOutput::close(RunFacts& facts) {
  facts.peak_resident = peakResidentBytes();
  observer_.finishKeeping();
  recorder_.commitMap();
  if (settings_.loop.enabled) attempt([&] { writeLoops(out_ / "loops.csv", observer_.loops()); });
  writeCalibration();
  if (!observer_.nodes().empty()) attempt([&] { writeMapPoses(out_ / "map.tum", observer_.nodes()); });
}

void RunOutput::writeCalibration() {
  const RunStatistics& statistics = observer_.statistics();
  const CalibrationEstimate* estimate = statistics.verdict.estimatedCalibration();
  if (estimate == nullptr) return;
  const double seconds = (*statistics.last_image - *statistics.first_image).seconds();
  const double rate = seconds > 0 ? static_cast<double>(statistics.frames) / seconds : 0;
  attempt([&] {
    writeEstimatedCalibration((out_ / "estimated_calibration").string(), calibration_, *estimate, rate);
  });
}

void RunOutput::smooth(const std::atomic<bool>* stop, bool announce) {
  attempt([&] {
    FullSmoothingOptions options = smoothingOptions(settings_, announce);
    options.stop = stop;
    const FullSmoothing found = smoothKeyframes(out_ / kKeyframeFile, options);
    RunStatistics& statistics = observer_.statistics();
    addTime(statistics.times, StageId::kMap, found.spent);
    for (const auto& row : found.faults.rows()) statistics.faults[row.text] += row.count;
    if (found.poses.empty()) {
      ++statistics.faults[found.problem];
      if (announce) warn(fmt::format("warning: not smoothed: {}\n", found.problem));
      return;
    }
    statistics.map = found.report;
    writeMapPoses(out_ / "map.tum", found.poses);
  });
}

nlohmann::ordered_json RunOutput::summary(const RunFacts& facts) {
  const RunStatistics& statistics = observer_.statistics();
  nlohmann::ordered_json summary = summaryOf(facts, settings_, statistics);
  const CalibrationEstimate* estimate = statistics.verdict.estimatedCalibration();
  const bool estimated = estimate != nullptr && estimate->shift_sigma > 0;
  summary["run"]["t_imu_minus_t_image_ns"] =
      (estimated ? estimate->camera_to_imu_shift : calibration_.rig.camera_to_imu_shift).ns;
  if (const char* problem = lost_.problem()) {
    summary["executor"]["files"] = {{"lost", lost_.count()}, {"first", problem}};
  }
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
  attempt([&] { writeJson(out_ / "summary.json", summary); });
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
