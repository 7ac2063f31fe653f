#include "firmware_host/lab/budget/budget_run.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "drivers/input/input_error.hpp"
#include "firmware_host/lab/budget/bare_timer_loop.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/runs/replay_run.hpp"

namespace swiftlet {
namespace {

const StageTimes& timesOf(const StageTable& table, StageId stage) {
  return table[static_cast<std::size_t>(stage)];
}

void addBoth(LatencyHistogram& sum, const LatencyHistogram& frames, const LatencyHistogram& keyframes) {
  sum.add(frames);
  sum.add(keyframes);
}

/// The load, running during this object's lifetime; none if not requested.
class Load {
 public:
  explicit Load(const BudgetRequest& request) {
    if (!request.load) return;
    const std::string failed = generator_.start(request.load_settings);
    if (!failed.empty()) {
      throw InputError("--load", 0, "", "cannot create the load: " + failed, "Use fewer workers");
    }
  }

 private:
  LoadGenerator generator_;
};

}  // namespace

void addMeasurements(const StageTable& times, BudgetMeasurements& sum) {
  const StageTimes& track = timesOf(times, StageId::kTrack);
  const StageTimes& smooth = timesOf(times, StageId::kSmooth);
  const StageTimes& mesh = timesOf(times, StageId::kMesh);
  const StageTimes& imu = timesOf(times, StageId::kImu);
  const StageTimes& pose = timesOf(times, StageId::kImageToPose);
  const StageTimes& exposure = timesOf(times, StageId::kExposureToPose);
  sum.propagate_cpu.add(imu.cpu_frames);
  addBoth(sum.track_cpu, track.cpu_frames, track.cpu_keyframes);
  addBoth(sum.track_wall, track.wall_frames, track.wall_keyframes);
  addBoth(sum.smooth_cpu, smooth.cpu_frames, smooth.cpu_keyframes);
  addBoth(sum.smooth_wall, smooth.wall_frames, smooth.wall_keyframes);
  addBoth(sum.mesh_cpu, mesh.cpu_frames, mesh.cpu_keyframes);
  addBoth(sum.image_to_pose_cpu, pose.cpu_frames, pose.cpu_keyframes);
  sum.image_to_pose_cpu_keyframes.add(pose.cpu_keyframes);
  sum.image_to_pose_cpu_frames.add(pose.cpu_frames);
  addBoth(sum.image_to_pose_wall, pose.wall_frames, pose.wall_keyframes);
  addBoth(sum.exposure_to_pose_wall, exposure.wall_frames, exposure.wall_keyframes);
  sum.sample_to_state_cpu.add(imu.cpu_frames);
  sum.sample_to_state_wall.add(imu.wall_frames);
}

BudgetResult runBudget(const BudgetRequest& request, const Settings& settings) {
  const Load load(request);
  BareTimerLoop timer;
  ThreadSettings same_as_track;
  same_as_track.name = "bare_timer";
  same_as_track.priority = settings.realtime.enabled ? settings.realtime.track_priority : 0;
  timer.start(same_as_track);
  BudgetMeasurements measured;
  measured.meshes = settings.mesh.enabled;
  BudgetResult result;
  nlohmann::ordered_json runs = nlohmann::ordered_json::array();
  Settings flight = settings;
  flight.full_smoothing = false;  // runs after the flight and has no budget
  for (int pass = 0; pass < request.passes; ++pass) {
    for (std::size_t i = 0; i < request.logs.size(); ++i) {
      ReplayRequest replay;
      replay.log = request.logs[i];
      replay.out = (std::filesystem::path(request.out) / fmt::format("run_{}_{}", pass + 1, i + 1)).string();
      replay.mono = request.mono;
      replay.real_time = true;
      replay.imu_rate = true;
      replay.show_progress = request.show_progress;
      replay.accuracy = runAccuracyJson;
      const ReplayResult run = runReplay(replay, flight);
      const RunStatistics& statistics = run.statistics;
      addMeasurements(statistics.times, measured);
      result.frames += statistics.frames;
      result.dropped += statistics.frames_dropped;
      result.effort_changes += statistics.effort_changes;
      nlohmann::ordered_json losses = nlohmann::ordered_json::object();
      for (const auto& [arrow, count] : statistics.losses) {
        losses[arrow] = count;
        result.losses += count;
      }
      runs.push_back({{"log", replay.log},
                      {"run", replay.out},
                      {"frames", statistics.frames},
                      {"frames_dropped", statistics.frames_dropped},
                      {"effort_changes", statistics.effort_changes},
                      {"losses", losses}});
    }
  }
  timer.stop();
  measured.bare_timer_wall = timer.lateness();
  result.report = evaluateBudgets(measured, settings.budgets);
  result.json = result.report.json();
  result.json["load"] = request.load;
  result.json["runs"] = runs;
  return result;
}

}  // namespace swiftlet
