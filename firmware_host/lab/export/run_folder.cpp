#include "firmware_host/lab/export/run_folder.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "drivers/input/input_error.hpp"
#include "firmware_host/lab/evaluation/association.hpp"
#include "firmware_host/outputs/run_folder/events_log.hpp"
#include "firmware_host/outputs/run_folder/states_csv.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTumRemedy =
    "A row is `t tx ty tz qx qy qz qw`, stamps rising. Replay again, or delete the row if a run that ended "
    "badly cut it short";
constexpr Duration kMapGap = Duration::fromMilliseconds(100);

Trajectory readIfThere(const fs::path& path) {
  return fs::exists(path) ? readWholeTrajectory(path, kTumRemedy) : Trajectory();
}

void requireFile(const fs::path& path) {
  if (fs::exists(path)) return;
  throw InputError(path, 0, "", "missing beside odometry.tum",
                   "Give the whole run folder, or replay the log again");
}

/// Finds the log of the run; a run that ended badly has no summary.
void readSummary(const fs::path& path, RunFolder& run) {
  if (!fs::exists(path)) return;
  std::ifstream file(path);
  const auto summary = nlohmann::ordered_json::parse(file, nullptr, false);
  if (summary.is_discarded() || !summary.is_object()) {
    throw InputError(path, 0, "", "not valid JSON",
                     "Replay again, or remove the file: it names the log only");
  }
  run.shift = cameraToImuShift(summary);
  const auto facts = summary.find("run");
  if (facts == summary.end() || !facts->is_object()) return;
  const auto log = facts->find("log");
  if (log == facts->end()) return;
  if (!log->is_string()) {
    throw InputError(path, 0, "run.log", "not a text",
                     "Replay again, or remove the file: it names the log only");
  }
  run.log = log->get<std::string>();
  run.from_tracks = facts->contains("tracks");
}

void sortKeyframes(std::vector<KeyframeState>& keyframes, const fs::path& file) {
  std::ranges::stable_sort(keyframes, {}, [](const KeyframeState& k) { return k.state.stamp; });
  for (std::size_t i = 1; i < keyframes.size(); ++i) {
    if (keyframes[i].state.stamp != keyframes[i - 1].state.stamp) continue;
    throw InputError(file, 0, "timestamp",
                     std::to_string(keyframes[i].state.stamp.ns) + " stands there twice",
                     "Replay the log again");
  }
}

}  // namespace

RunFolder readRunFolder(const std::string& path) {
  const fs::path folder(path);
  if (!fs::is_directory(folder)) {
    throw InputError(path, 0, "", "is no folder", "Give a folder that replay, fly, mesh or fuse wrote");
  }
  RunFolder run;
  run.path = path;
  run.given_poses = !fs::exists(folder / "odometry.tum");
  run.odometry_file = run.given_poses ? "trajectory.tum" : "odometry.tum";
  if (!fs::exists(folder / run.odometry_file)) {
    throw InputError(path, 0, "", "no odometry.tum in this folder",
                     "Give a folder that replay, fly, mesh or fuse wrote");
  }
  run.odometry = readWholeTrajectory(folder / run.odometry_file, kTumRemedy);
  if (!run.given_poses) {
    requireFile(folder / "states.csv");
    requireFile(folder / "events.log");
    run.keyframes = readKeyframes(folder / "states.csv");
    sortKeyframes(run.keyframes, folder / "states.csv");
    run.events = readEvents((folder / "events.log").string());
    run.imu_rate = readIfThere(folder / "imu_rate.tum");
    run.map = readIfThere(folder / "map.tum");
  }
  if (fs::exists(folder / "meshes" / "frames.csv")) run.meshes = readMeshFrames(folder / "meshes");
  if (fs::exists(folder / "local_mesh.ply")) run.local_mesh = folder / "local_mesh.ply";
  if (fs::exists(folder / "map.ply")) run.map_mesh = folder / "map.ply";
  readSummary(folder / "summary.json", run);
  return run;
}

std::vector<SE3> mapCorrections(const RunFolder& run) {
  struct Correction {
    Stamp stamp;
    SE3 T_map_world;
  };
  std::vector<Correction> known;
  for (const TrajectoryPoint& keyframe : run.map) {
    const std::optional<SE3> T_world_body = interpolate(run.odometry, keyframe.stamp, kMapGap);
    if (T_world_body) known.push_back({keyframe.stamp, keyframe.T_world_body * T_world_body->inverse()});
  }
  std::vector<SE3> corrections;
  corrections.reserve(run.odometry.size());
  for (const TrajectoryPoint& point : run.odometry) {
    const auto after = std::ranges::upper_bound(known, point.stamp, {}, &Correction::stamp);
    if (known.empty()) {
      corrections.emplace_back();
    } else if (after == known.begin()) {
      corrections.push_back(after->T_map_world);
    } else if (after == known.end()) {
      corrections.push_back(known.back().T_map_world);
    } else {
      const Correction& before = *(after - 1);
      const double share = (point.stamp - before.stamp).seconds() / (after->stamp - before.stamp).seconds();
      const Eigen::Quaterniond q = before.T_map_world.rotation.slerp(share, after->T_map_world.rotation);
      const Eigen::Vector3d& p = point.T_world_body.translation;
      const Eigen::Vector3d p_map = (1 - share) * (before.T_map_world * p) + share * (after->T_map_world * p);
      corrections.emplace_back(q, p_map - q * p);
    }
  }
  return corrections;
}

}  // namespace swiftlet
