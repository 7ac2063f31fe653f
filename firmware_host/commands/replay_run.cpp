#include "firmware_host/commands/replay_run.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>

#include "drivers/recorded/open_log.hpp"
#include "drivers/recorded/recording_source.hpp"
#include "firmware_host/commands/confusion_file.hpp"
#include "firmware_host/commands/evaluate_run.hpp"
#include "firmware_host/commands/fly_threaded.hpp"
#include "firmware_host/commands/moving_labels.hpp"
#include "firmware_host/pipeline/flight_recorder.hpp"
#include "firmware_host/pipeline/lockstep.hpp"
#include "firmware_host/pipeline/reproduce.hpp"
#include "firmware_host/places/vocabulary_file.hpp"
#include "firmware_host/report/line_file.hpp"
#include "firmware_host/report/loops_csv.hpp"
#include "firmware_host/report/memory_use.hpp"
#include "firmware_host/report/progress.hpp"
#include "firmware_host/report/run_recorder.hpp"
#include "firmware_host/report/summary.hpp"
#include "firmware_host/settings/read_settings.hpp"

namespace swiftlet {
namespace {

LogOptions logOptions(const ReplayRequest& request, const Settings& settings) {
  LogOptions options;
  options.calibration = request.calibration;
  options.imu_calibration = request.imu_calibration;
  options.calibration_options.accept_unusual_rig = settings.calibration.accept_unusual_rig;
  options.mono = request.mono;
  options.without_images = !request.tracks.empty();
  return options;
}

/// Reads the whole file once, so that a bad one is refused before anything is written.
TrackFileFacts checkTracks(const std::string& path, const Rig& rig, bool mono) {
  const TrackFileFacts facts = surveyTrackFile(path);
  if (!mono && facts.cameras > rig.camera_count) {
    throw InputError(path, 0, "camera", "has sightings of camera 1, the calibration has camera 0 only",
                     "Give the calibration of both with --calibration, or leave camera 1 out with --mono");
  }
  return facts;
}

void printWarnings(const LogSource& source, std::size_t from) {
  const auto& lines = source.warnings();
  for (std::size_t i = from; i < lines.size(); ++i) fmt::print(stderr, "warning: {}\n", lines[i]);
}

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

void writeMap(const std::string& path, const std::vector<MapPose>& poses) {
  if (poses.empty()) return;
  LineFile file(path);
  for (const MapPose& pose : poses) file.write(formatTum(pose.stamp, pose.T_world_body));
}

/// What one run is made of, from opening to the summary.
class ReplayRun {
 public:
  ReplayRun(const ReplayRequest& request, Settings settings, const ReplayHooks& hooks)
      : request_(request), settings_(std::move(settings)), hooks_(hooks) {
    if (request_.mono) settings_.odometry.use_stereo = false;
    if (request_.loop_closure) settings_.loop.enabled = true;
    if (request_.map) settings_.map.enabled = true;
  }

  ReplayResult operator()() {
    open();
    begin();
    const double wall = wallSeconds();
    const double cpu = processCpuSeconds();
    if (request_.reproduce) {
      repeat();
    } else {
      fly();
    }
    facts_.wall = wallSeconds() - wall;
    facts_.cpu = processCpuSeconds() - cpu;
    return end();
  }

 private:
  void open() {
    const LogOptions options = logOptions(request_, settings_);
    if (request_.reproduce) {
      std::unique_ptr<RecordingSource> recording = openRecording(request_.log, options);
      recording_ = recording.get();
      source_ = std::move(recording);
      settings_ = Settings{};
      readSettingsText(request_.log, recording_->header().settings, settings_);
    } else {
      source_ = openLog(request_.log, options);
    }
    printWarnings(*source_, 0);
    warned_ = source_->warnings().size();
    memory_.note("log_reader");
    facts_.log = request_.log;
    facts_.tracks = request_.tracks.empty() ? source_->trackFile() : request_.tracks;
    steps_ = source_->imageCount();
    openScenes();
    if (facts_.tracks.empty()) return;
    if (request_.real_time || request_.record) {
      throw InputError(request_.log, 0, "", "a log of feature tracks has no images to let out or record",
                       "Leave --real-time and --record out");
    }
    steps_ = checkTracks(facts_.tracks, source_->rig(), request_.mono).frames;
    tracks_ = std::make_unique<TrackReader>(facts_.tracks);
  }

  /// Refuses what cannot be mapped before anything is written.
  void openScenes() {
    if (!settings_.map.enabled || request_.reproduce) return;
    checkMovingLabels(settings_.map_stage);
    confusion_ = confusionOf(settings_);
    if (!facts_.tracks.empty()) {
      throw InputError(request_.log, 0, "", "a log of feature tracks has no images to map",
                       "Leave --map out");
    }
    scenes_.emplace(request_.log, source_->calibration(),
                    SceneReader::Wanted{settings_.map.depth_sensor, settings_.map_stage.labels});
    for (const std::string& line : scenes_->warnings()) fmt::print(stderr, "warning: {}\n", line);
    scene_warnings_ = scenes_->warnings().size();
    if (scenes_->depthSensor() == nullptr &&
        (source_->rig().camera_count < 2 || !settings_.odometry.use_stereo)) {
      throw InputError(request_.log, 0, "", "one camera and no depth images: nothing gives depth for --map",
                       "Give a log with two cameras or with mav0/depth0, or leave --map out");
    }
  }

  void begin() {
    facts_.mono = !settings_.odometry.use_stereo || source_->rig().camera_count < 2;
    recorder_.emplace(request_.out, request_.imu_rate, request_.mesh_sequence);
    LineFile(out() / "settings.yaml").write(printSettings(settings_, false));
    log_.emplace(*recorder_);
    if (settings_.full_smoothing) {
      log_->keepForMap(
          std::make_unique<MapKeeper>(request_.out, source_->rig(), source_->imuNoise(), settings_.odometry));
    }
    progress_.emplace("replay", request_.show_progress ? steps_ : 0);
    control_.stop = request_.stop;
    control_.progress = [this](std::uint64_t images) { progress_->update(images); };
  }

  /// Null: the shipped one.
  const Vocabulary* vocabulary() {
    const std::string& file = settings_.loop.vocabulary;
    if (!settings_.loop.enabled || file.empty()) return nullptr;
    if (!vocabulary_) vocabulary_ = std::make_unique<const Vocabulary>(readVocabulary(file));
    return vocabulary_.get();
  }

  void repeat() {
    const ReproduceReport report =
        reproduce(*recording_, settings_, *log_, request_.imu_rate, control_, vocabulary());
    facts_.finished = report.finished && report.stopped_early.empty();
    facts_.executor["kind"] = "reproduced";
    if (report.stopped_early.empty()) return;
    facts_.executor["stopped_early"] = report.stopped_early;
    fmt::print(stderr, "warning: {}: the run was repeated for {} frames: {}\n", request_.log, report.frames,
               report.stopped_early);
  }

  void fly() {
    std::unique_ptr<FlightRecorder> flight_recorder;
    if (request_.record) flight_recorder = startRecorder();
    Wiring::Options wanted;
    wanted.imu_states = request_.imu_rate;
    wanted.meshes = request_.mesh_sequence;
    wanted.recorder = flight_recorder.get();
    wanted.drag = hooks_.drag;
    wanted.vocabulary = vocabulary();
    if (scenes_) wanted.depth_sensor = scenes_->depthSensor();
    wanted.spill = &recorder_->spilled();
    wanted.confusion = confusion_;
    LogFeed feed(*source_, {request_.from, request_.until, request_.last_stamp}, tracks_.get(),
                 scenes_ ? &*scenes_ : nullptr);
    if (request_.real_time) {
      FlightRequest flight;
      flight.speed = request_.speed;
      flight.watch = hooks_.watch;
      flight.announce = request_.show_progress;
      facts_.finished =
          flyThreaded(*source_, feed, settings_, *log_, wanted, flight, control_, facts_.executor);
    } else {
      const auto wiring =
          std::make_unique<Wiring>(source_->rig(), source_->imuNoise(), settings_, *log_, wanted);
      memory_.note("estimator_at_start");
      facts_.finished = runLockstep(feed, *wiring, control_);
      log_->collect(*wiring);
      facts_.executor["kind"] = "lockstep";
    }
    log_->statistics().times[static_cast<std::size_t>(StageId::kSource)] = feed.times();
    if (flight_recorder) facts_.executor["recording"] = recordingJson(*flight_recorder);
  }

  std::unique_ptr<FlightRecorder> startRecorder() {
    RecordingHeader header;
    header.rig = source_->rig();
    header.noise = source_->imuNoise();
    header.calibration_form = source_->calibration().form;
    header.settings = printSettings(settings_, false);
    header.program_version = versionText();
    header.order = RecordOrder::kAsWritten;  // one thread feeds the estimator
    return std::make_unique<FlightRecorder>((out() / "recording").string(), header);
  }

  ReplayResult end() {
    progress_->finish();
    memory_.note("grown_in_flight");
    facts_.memory = memory_.rows();
    facts_.peak_resident = peakResidentBytes();
    writeMap(out() / "map.tum", log_->solveMap());
    if (settings_.loop.enabled) writeLoops(out() / "loops.csv", log_->loops());
    printWarnings(*source_, warned_);
    for (std::size_t i = scene_warnings_; scenes_ && i < scenes_->warnings().size(); ++i) {
      fmt::print(stderr, "warning: {}\n", scenes_->warnings()[i]);
    }
    if (tracks_) {
      facts_.track_surplus = tracks_->surplus();
      facts_.track_warnings = tracks_->warnings();
      for (const std::string& line : facts_.track_warnings) fmt::print(stderr, "warning: {}\n", line);
    }
    ReplayResult result;
    result.statistics = log_->statistics();
    result.finished = facts_.finished;
    result.has_pose = result.statistics.first_pose.has_value();
    result.summary = summaryOf(facts_, settings_, *source_, result.statistics);
    if (!recorder_->map().is_null()) {
      result.summary["map"] = recorder_->map();
      const MapThreadStatistics& mapping = *result.statistics.mapping;
      result.summary["map"]["frames"] = {{"to_map", mapping.frames},
                                         {"without_image", mapping.without_image},
                                         {"without_scene", mapping.without_scene},
                                         {"refused", mapping.refused}};
    }
    const Trajectory truth = source_->groundTruth();
    if (!truth.empty() && result.has_pose) {
      result.summary["accuracy"] = runAccuracyJson(request_.out, truth, source_->groundTruthName(),
                                                   *result.statistics.first_image, settings_.evaluation);
    }
    writeJson(out() / "summary.json", result.summary);
    return result;
  }

  [[nodiscard]] std::filesystem::path out() const { return request_.out; }

  const ReplayRequest& request_;
  Settings settings_;
  const ReplayHooks& hooks_;
  MemoryTrack memory_;
  std::unique_ptr<const Vocabulary> vocabulary_;
  std::unique_ptr<LogSource> source_;
  RecordingSource* recording_ = nullptr;  ///< source_, when it is to be repeated
  std::unique_ptr<TrackReader> tracks_;
  std::optional<SceneReader> scenes_;
  std::size_t scene_warnings_ = 0;
  std::optional<ConfusionModel> confusion_;
  std::size_t warned_ = 0;
  std::size_t steps_ = 0;
  std::optional<RunRecorder> recorder_;
  std::optional<RunLog> log_;
  std::optional<Progress> progress_;
  RunControl control_;
  RunFacts facts_;
};

}  // namespace

ReplayResult runReplay(const ReplayRequest& request, Settings settings, const ReplayHooks& hooks) {
  return ReplayRun(request, std::move(settings), hooks)();
}

}  // namespace swiftlet
