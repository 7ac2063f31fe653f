#include "firmware_host/runs/replay_run.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/recorded/open_log.hpp"
#include "drivers/recorded/recording_files.hpp"
#include "drivers/recorded/recording_source.hpp"
#include "estimator/core/units.hpp"
#include "firmware_host/files/run_claim.hpp"
#include "firmware_host/inputs/log/log_player.hpp"
#include "firmware_host/inspection/inspect_log.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/progress.hpp"
#include "firmware_host/runs/fly_threaded.hpp"
#include "firmware_host/runs/run_output.hpp"
#include "firmware_host/schedule/lockstep.hpp"
#include "firmware_host/schedule/recorded.hpp"
#include "firmware_host/settings/map_check.hpp"
#include "firmware_host/settings/read_settings.hpp"

namespace swiftlet {
namespace {

/// Reads the whole file once, so that a bad one is refused before anything is written.
TrackFileFacts checkTracks(const std::string& path, const LogSource& log, bool mono) {
  const TrackFileFacts facts = surveyTrackFile(path);
  const auto samples = log.sampleSpan();
  if (samples && (samples->second < facts.first || samples->first > facts.last)) {
    throw InputError(
        path, 0, "timestamp",
        fmt::format("the log's samples ({} to {}) and the tracks ({} to {}) do not overlap in time",
                    samples->first.ns, samples->second.ns, facts.first.ns, facts.last.ns),
        "Use stamps of one clock, in nanoseconds");
  }
  if (!mono && facts.cameras > log.rig().camera_count) {
    throw InputError(path, 0, "camera", "has features of camera 1, but the calibration has only camera 0",
                     "Give the calibration of both cameras with --calibration, or omit camera 1 with --mono");
  }
  return facts;
}

// Ten seconds of motion at 20 Hz; costs half a second of CPU time.
constexpr std::size_t kInspectedImages = 200;

/// The parts of one run, from opening to the summary.
class ReplayRun {
 public:
  ReplayRun(const ReplayRequest& request, Settings settings, const ReplayHooks& hooks)
      : request_(request), settings_(std::move(settings)), hooks_(hooks) {
    if (request_.mono) settings_.odometry.use_stereo = false;
    if (request_.loop_closure) settings_.loop.enabled = true;
    request_.kept_maps.apply(settings_);
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
    LogOptions options = request_.options(settings_);
    options.without_images = !request_.tracks.empty();
    if (request_.reproduce) {
      std::unique_ptr<RecordingSource> recording = openRecording(request_.log, options);
      recording_ = recording.get();
      if (const auto loss = recording_->firstLoss()) throw *loss;
      source_ = std::move(recording);
      settings_ = Settings{};
      readSettingsText(request_.log, recording_->header().settings, settings_);
    } else {
      source_ = openLog(request_.log, options);
    }
    warnAll(source_->warnings());
    warned_ = source_->warnings().size();
    memory_.note("log_reader");
    facts_.log = request_.log;
    facts_.tracks = request_.tracks.empty() ? source_->trackFile() : request_.tracks;
    steps_ = source_->imageCount();
    openScenes();
    if (request_.inspect && !request_.reproduce) inspect();
    warnAll(findings_);
    if (facts_.tracks.empty()) return;
    if (request_.real_time || request_.record) {
      throw InputError(request_.log, 0, "", "a log of feature tracks has no images to feed or record",
                       "Omit --real-time and --record");
    }
    steps_ = checkTracks(facts_.tracks, *source_, request_.mono).frames;
    tracks_ = std::make_unique<TrackReader>(facts_.tracks);
  }

  /// Uses a log opened only for this, so that what the run reads and delivers stays the same.
  void inspect() {
    if (!facts_.tracks.empty()) return;
    for (const Finding& finding : inspectLog(request_, settings_, kInspectedImages).findings) {
      findings_.push_back(finding.line());
    }
    memory_.note("inspection");
  }

  /// Refuses what cannot be mapped, before anything is written.
  void openScenes() {
    if (!settings_.map.enabled || request_.reproduce) return;
    checkMapSettings(settings_.map_stage);
    if (!facts_.tracks.empty()) {
      throw InputError(request_.log, 0, "", "a log of feature tracks has no images to map", "Omit --map");
    }
    scenes_.emplace(request_.log, source_->calibration(),
                    SceneReader::Wanted{settings_.map.depth_sensor, settings_.map_stage.labels});
    for (const std::string& line : scenes_->warnings()) warn("warning: " + line + "\n");
    scene_warnings_ = scenes_->warnings().size();
    if (scenes_->depthSensor() == nullptr &&
        (source_->rig().camera_count < 2 || !settings_.odometry.use_stereo)) {
      throw InputError(request_.log, 0, "", "one camera and no depth images: --map has no source of depth",
                       "Give a log with two cameras or with mav0/depth0, or omit --map");
    }
    const std::string line = scenes_->depthSensor() == nullptr ? nearDepthWarning(source_->rig()) : "";
    if (!line.empty()) findings_.push_back(line);
  }

  /// Claiming a folder deletes an earlier run in it, including its recording.
  void refuseOwnLog() const {
    const std::string recording = findRecordingFolder(request_.log);
    if (recording.empty()) return;
    std::error_code error;
    const std::filesystem::path out(request_.out);
    for (const auto& folder : {out, out / "recording"}) {
      if (!std::filesystem::equivalent(folder, recording, error)) continue;
      throw InputError(request_.out, 0, "", "is the folder of the recording being replayed",
                       "Give another folder with --out");
    }
  }

  void begin() {
    facts_.mono = !settings_.odometry.use_stereo || source_->rig().camera_count < 2;
    refuseOwnLog();
    RunInputs inputs = readRunInputs(settings_, request_.kept_maps.keep);
    claim_.emplace(request_.out, RunKind::kReplay, request_.replace);
    output_.emplace(request_.out, settings_, source_->calibration(),
                    RunOutput::Wanted{request_.imu_rate, request_.mesh_sequence, request_.kept_maps.keep},
                    std::move(inputs), lost_);
    progress_.emplace("replay", request_.show_progress ? steps_ : 0);
    control_.stop = request_.stop;
    control_.progress = [this](std::uint64_t images) { progress_->update(images); };
  }

  void repeat() {
    RecordedEfforts efforts;
    GraphOptions wanted = output_->graphOptions();
    wanted.track_effort = &efforts.track;
    wanted.smooth_effort = &efforts.smooth;
    const auto& depth_sensor = recording_->header().depth_sensor;
    if (depth_sensor) wanted.depth_sensor = &*depth_sensor;
    const auto graph =
        std::make_unique<Graph>(source_->rig(), source_->imuNoise(), settings_, output_->observer(), wanted);
    const RepeatReport report = runRecorded(*recording_, *graph, efforts, control_);
    graph->report(output_->observer());
    facts_.finished = report.finished && report.stopped_early.empty();
    facts_.executor["kind"] = "reproduced";
    if (report.stopped_early.empty()) return;
    facts_.executor["stopped_early"] = report.stopped_early;
    warn(fmt::format("warning: {}: the run was reproduced for {} frames: {}\n", request_.log, report.frames,
                     report.stopped_early));
  }

  void fly() {
    if (request_.record) {  // as written, because one thread feeds the estimator
      recorder_ = output_->startRecorder(RecordOrder::kAsWritten, scenes_ ? scenes_->depthSensor() : nullptr);
    }
    GraphOptions wanted = output_->graphOptions();
    wanted.recorder = recorder_.get();
    wanted.drag = hooks_.drag;
    if (scenes_) wanted.depth_sensor = scenes_->depthSensor();
    LogFeed& feed = feed_.emplace(*source_, request_.section(), tracks_.get(), scenes_ ? &*scenes_ : nullptr);
    if (request_.real_time) {
      FlightRequest flight;
      flight.speed = request_.speed;
      flight.announce = request_.show_progress;
      // Also for a folder name that ends with a slash.
      const std::filesystem::path log = std::filesystem::path(request_.log).lexically_normal();
      flight.name = (log.has_filename() ? log : log.parent_path()).filename().string();
      flight.view = request_.view;
      flight.before_turn = hooks_.before_turn;
      flight.verdict = hooks_.verdict;
      flight.record = request_.record;
      flight.file_problem = [this] { return lost_.problem(); };
      LogPlayer& player = player_.emplace(feed, request_.speed);
      flight.to_host = [&player] { return player.toHost(); };
      const FlightEnd flown = flyThreaded(source_->calibration(), player, settings_, output_->observer(),
                                          wanted, flight, control_, facts_.executor);
      facts_.finished = flown.finished && flown.faultless;
      left_behind_ = flown.left_behind;
      const LatencyHistogram& late = player.lateness();
      facts_.executor["late_ms"] = {{"p50", late.percentile(0.5) * kToMs},
                                    {"p99", late.percentile(0.99) * kToMs},
                                    {"max", late.max() * kToMs}};
    } else {
      const auto graph = std::make_unique<Graph>(source_->rig(), source_->imuNoise(), settings_,
                                                 output_->observer(), wanted);
      memory_.note("estimator_at_start");
      facts_.finished = runLockstep(feed, *graph, control_);
      graph->report(output_->observer());
      facts_.executor["kind"] = "lockstep";
    }
    output_->observer().statistics().times[static_cast<std::size_t>(StageId::kSource)] = feed.times();
    if (recorder_) facts_.executor["recording"] = recordingJson(*recorder_);
  }

  ReplayResult end() {
    progress_->finish();
    memory_.note("grown_in_flight");
    facts_.memory = memory_.rows();
    warnAll(source_->warnings(), warned_);
    for (std::size_t i = scene_warnings_; scenes_ && i < scenes_->warnings().size(); ++i) {
      warn("warning: " + scenes_->warnings()[i] + "\n");
    }
    if (tracks_) {
      facts_.track_surplus = tracks_->surplus();
      for (const std::string& line : tracks_->warnings()) warn("warning: " + line + "\n");
    }
    ReplayResult result;
    result.finished = facts_.finished;
    result.left_behind = left_behind_;
    facts_.calibration_form = source_->calibration().form;
    facts_.input["log"] = toJson(source_->counters());
    facts_.warnings = source_->warnings();
    facts_.warnings.insert(facts_.warnings.end(), findings_.begin(), findings_.end());
    if (tracks_) {
      facts_.warnings.insert(facts_.warnings.end(), tracks_->warnings().begin(), tracks_->warnings().end());
    }
    output_->close(facts_);
    if (output_->canSmooth()) {
      // Smoothing takes time; the run is useful without it, so the summary is written first.
      output_->writeSummary(output_->summary(facts_));
      output_->smooth(request_.stop, request_.show_progress);
    }
    result.summary = output_->summary(facts_);
    result.statistics = output_->observer().statistics();
    result.has_pose = result.statistics.first_pose.has_value();
    addAccuracy(result);
    output_->writeSummary(result.summary);
    if (const char* problem = lost_.problem()) result.lost = problem;
    return result;
  }

  /// Errors only give a warning: the run is useful without accuracy.
  void addAccuracy(ReplayResult& result) {
    if (!request_.accuracy || !result.has_pose) return;
    try {
      LogWarnings left_out;
      const Trajectory truth = onImageClock(source_->groundTruth(left_out), cameraToImuShift(result.summary));
      warnAll(left_out.lines());
      for (const std::string& line : left_out.lines()) result.summary["warnings"].push_back(line);
      if (truth.empty()) return;
      result.summary["accuracy"] = request_.accuracy(request_.out, truth, source_->groundTruthName(),
                                                     *result.statistics.first_image, settings_.evaluation);
    } catch (const InputError& error) {
      const std::string line = fmt::format("accuracy left out: {}", error.what());
      warn("warning: " + line + "\n");
      result.summary["warnings"].push_back(line);
    }
  }

  const ReplayRequest request_;
  Settings settings_;
  const ReplayHooks hooks_;
  MemoryTrack memory_;
  std::unique_ptr<LogSource> source_;
  RecordingSource* recording_ = nullptr;  ///< source_, if the run repeats a recording
  std::unique_ptr<TrackReader> tracks_;
  std::optional<SceneReader> scenes_;
  std::size_t scene_warnings_ = 0;
  std::size_t warned_ = 0;
  std::vector<std::string> findings_;
  std::size_t steps_ = 0;
  LostFiles lost_;
  std::optional<RunClaim> claim_;
  std::optional<RunOutput> output_;
  std::unique_ptr<FlightRecorder> recorder_;
  std::optional<LogFeed> feed_;
  std::optional<LogPlayer> player_;
  std::optional<Progress> progress_;
  RunControl control_;
  RunFacts facts_;
  bool left_behind_ = false;
};

}  // namespace

ReplayResult runReplay(const ReplayRequest& request, Settings settings, const ReplayHooks& hooks) {
  auto run = std::make_unique<ReplayRun>(request, std::move(settings), hooks);
  ReplayResult result = (*run)();
  // Leaked on purpose: a stuck thread may continue at any time.
  if (result.left_behind) static_cast<void>(run.release());
  return result;
}

}  // namespace swiftlet
