#include "firmware_host/report/run_recorder.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "drivers/calibration/input_error.hpp"
#include "drivers/recorded/trajectory_file.hpp"
#include "firmware_host/report/events_log.hpp"
#include "firmware_host/report/map_output.hpp"
#include "firmware_host/report/names.hpp"
#include "firmware_host/report/ply_file.hpp"
#include "firmware_host/report/states_csv.hpp"

namespace swiftlet {
namespace {

/// The event's value in words where it is a code, as a number otherwise.
std::string valueText(const Event& event) {
  if (event.kind == EventKind::kHealthChanged) {
    return std::string(healthName(static_cast<Health>(static_cast<int>(event.value))));
  }
  return fmt::format("{:g}", event.value);
}

}  // namespace

RunRecorder::RunRecorder(const std::string& folder, bool imu_rate, bool meshes)
    : folder_(folder), spilled_(folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    throw InputError(folder, 0, "", "the run folder cannot be created: " + error.message(),
                     "Give another folder with --out");
  }
  const std::filesystem::path path(folder);
  // What an earlier run left and this one does not write would be taken for this one's.
  for (const char* name : {"imu_rate.tum", "imu_rate_health.csv", "map.tum", "loops.csv", "local_mesh.ply",
                           "map.ply", "map.glb", "meshes", "summary.json"}) {
    std::filesystem::remove_all(path / name, error);
  }
  if (meshes) meshes_.emplace(folder);
  odometry_.emplace(path / "odometry.tum");
  if (imu_rate) {
    imu_rate_.emplace(path / "imu_rate.tum");
    imu_rate_health_.emplace(path / "imu_rate_health.csv");
    imu_rate_health_->write("#timestamp [ns],health,epoch");
  }
  states_.emplace(path / "states.csv");
  states_->write(statesHeader());
  events_.emplace(path / "events.log");
}

void RunRecorder::onFrame(const TrackedFrame& tracked, const OdometryOutput& output) {
  writeEvents(output);
  writeKeyframes(output);
  // One line per image at the image's own stamp; the state's is the same instant on the IMU's clock.
  if (output.has_state) odometry_->write(formatTum(tracked.stamp, output.state.T_world_body));
}

void RunRecorder::onImuState(const NavState& state) {
  if (!imu_rate_) return;
  imu_rate_->write(formatTum(state.stamp, state.T_world_body));
  if (health_ == state.health && epoch_ == state.epoch) return;
  health_ = state.health;
  epoch_ = state.epoch;
  imu_rate_health_->write(fmt::format("{},{},{}", state.stamp.ns, healthName(state.health), state.epoch));
}

void RunRecorder::onMesh(bool keyframe, const LocalMesh& frame, const LocalMesh* horizon,
                         std::span<const Eigen::Vector2f> hull) {
  if (meshes_) meshes_->write(keyframe, frame, horizon, hull);
}

void RunRecorder::onLocalMesh(const LocalMesh& mesh) {
  writePly((std::filesystem::path(folder_) / "local_mesh.ply").string(), toTriangleMesh(mesh));
}

void RunRecorder::onMap(MapStage& map, std::span<const std::uint32_t> tied) {
  map_ = writeMap(folder_, map, spilled_, tied);
}

void RunRecorder::onFinish(const OdometryOutput& output) {
  writeEvents(output);
  writeKeyframes(output);
}

void RunRecorder::onRemark(Stamp stamp, const std::string& text) {
  events_->write(fmt::format("{} {} {}", formatSeconds(stamp), kRemarkName, text));
}

void RunRecorder::writeEvents(const OdometryOutput& output) {
  for (const Event& event : output.events) {
    events_->write(
        fmt::format("{} {} {}", formatSeconds(event.stamp), eventName(event.kind), valueText(event)));
  }
}

void RunRecorder::writeKeyframes(const OdometryOutput& output) {
  for (const KeyframeState& keyframe : output.left_window) states_->write(statesRow(keyframe));
}

}  // namespace swiftlet
