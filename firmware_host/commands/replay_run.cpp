#include "firmware_host/commands/replay_run.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "drivers/recorded/open_log.hpp"
#include "firmware_host/commands/evaluate_run.hpp"
#include "firmware_host/pipeline/lockstep.hpp"
#include "firmware_host/report/line_file.hpp"
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
class MemoryTable {
 public:
  MemoryTable() : last_(residentBytes()) { rows_.push_back({"program_at_start", last_}); }
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

void writeMap(const std::string& path, const std::vector<MapPose>& poses) {
  if (poses.empty()) return;
  LineFile file(path);
  for (const MapPose& pose : poses) file.write(formatTum(pose.stamp, pose.T_world_body));
}

}  // namespace

ReplayResult runReplay(const ReplayRequest& request, Settings settings) {
  if (request.mono) settings.odometry.use_stereo = false;
  MemoryTable memory;
  const std::unique_ptr<LogSource> source = openLog(request.log, logOptions(request, settings));
  printWarnings(*source, 0);
  const std::size_t warned = source->warnings().size();
  memory.note("log_reader");

  RunFacts facts;
  facts.log = request.log;
  facts.tracks = request.tracks.empty() ? source->trackFile() : request.tracks;
  std::size_t steps = source->imageCount();
  std::unique_ptr<TrackReader> tracks;
  if (!facts.tracks.empty()) {
    steps = checkTracks(facts.tracks, source->rig(), request.mono).frames;
    tracks = std::make_unique<TrackReader>(facts.tracks);
  }

  RunRecorder recorder(request.out, request.imu_rate);
  const std::filesystem::path out(request.out);
  LineFile(out / "settings.yaml").write(printSettings(settings, false));
  RunLog log(recorder);
  if (settings.full_smoothing) {
    log.keepForMap(
        std::make_unique<MapKeeper>(request.out, source->rig(), source->imuNoise(), settings.odometry));
  }
  Wiring::Options wanted;
  wanted.imu_states = request.imu_rate;
  const auto wiring = std::make_unique<Wiring>(source->rig(), source->imuNoise(), settings, log, wanted);
  memory.note("estimator_at_start");

  Progress progress("replay", request.show_progress ? steps : 0);
  RunControl control;
  control.stop = request.stop;
  control.progress = [&](std::uint64_t images) { progress.update(images); };
  LogFeed feed(*source, {request.from, request.until, request.last_stamp}, tracks.get());

  facts.mono = !settings.odometry.use_stereo || source->rig().camera_count < 2;
  const double wall = wallSeconds();
  const double cpu = processCpuSeconds();
  facts.finished = runLockstep(feed, *wiring, control);
  facts.wall = wallSeconds() - wall;
  facts.cpu = processCpuSeconds() - cpu;
  progress.finish();
  memory.note("grown_in_flight");
  facts.memory = memory.rows();
  facts.peak_resident = peakResidentBytes();
  log.collect(*wiring);
  RunStatistics& statistics = log.statistics();
  statistics.times[static_cast<std::size_t>(StageId::kSource)] = feed.times();
  writeMap(out / "map.tum", log.solveMap());
  printWarnings(*source, warned);
  if (tracks) {
    facts.track_surplus = tracks->surplus();
    facts.track_warnings = tracks->warnings();
    for (const std::string& line : facts.track_warnings) fmt::print(stderr, "warning: {}\n", line);
  }

  ReplayResult result;
  result.finished = facts.finished;
  result.has_pose = statistics.first_pose.has_value();
  result.summary = summaryOf(facts, settings, *source, statistics);
  const Trajectory truth = source->groundTruth();
  if (!truth.empty() && result.has_pose) {
    result.summary["accuracy"] = runAccuracyJson(request.out, truth, source->groundTruthName(),
                                                 *statistics.first_image, settings.evaluation);
  }
  writeJson(out / "summary.json", result.summary);
  return result;
}

}  // namespace swiftlet
