#include "firmware_host/outputs/run_folder/run_recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/trajectory_file.hpp"
#include "estimator/messages/names.hpp"
#include "firmware_host/outputs/map_files/map_output.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "firmware_host/outputs/run_folder/events_log.hpp"
#include "firmware_host/outputs/run_folder/states_csv.hpp"
#include "mapping/loop/loop_stage.hpp"

namespace swiftlet {
namespace {

/// The event's value: the name of a code, otherwise a number.
std::string valueText(const Event& event) {
  if (event.kind == EventKind::kHealthChanged) {
    return std::string(healthName(static_cast<Health>(static_cast<int>(event.value))));
  }
  if (event.kind == EventKind::kDoubt) {
    return std::string(doubtName(static_cast<Doubt>(static_cast<int>(event.value))));
  }
  return fmt::format("{:g}", event.value);
}

}  // namespace

RunRecorder::RunRecorder(const std::string& folder, const Wanted& wanted, LostFiles& lost)
    : folder_(folder), wanted_(wanted), lost_(lost), storage_(folder) {
  if (!wanted.keep_map.empty()) kept_.emplace(wanted.keep_map);  // what is asked for is refused in time
  if (folder.empty()) return;
  const std::filesystem::path path(folder);
  if (wanted.in_map) open(in_map_, path / "in_map.tum");
  if (wanted.meshes) open(meshes_, folder);
  open(odometry_, path / "odometry.tum");
  if (wanted.imu_rate) {
    open(imu_rate_, path / "imu_rate.tum");
    open(imu_rate_health_, path / "imu_rate_health.csv");
    writeTo(imu_rate_health_, [](LineFile& file) { file.write("#timestamp [ns],health,epoch"); });
  }
  open(states_, path / "states.csv");
  writeTo(states_, [](LineFile& file) { file.write(statesHeader()); });
  open(events_, path / "events.log");
}

template <typename Write>
void RunRecorder::attempt(const Write& write) {
  try {
    write();
  } catch (const InputError& error) {
    lost_.add(error.what());
  }
}

template <typename File, typename... Arguments>
void RunRecorder::open(std::optional<File>& file, Arguments&&... arguments) {
  if (!wanted_.fly_on) {
    file.emplace(arguments...);
    return;
  }
  attempt([&] { file.emplace(arguments...); });
}

template <typename File, typename Write>
void RunRecorder::writeTo(std::optional<File>& file, const Write& write) {
  if (!file) return;
  try {
    write(*file);
  } catch (const InputError& error) {
    lost_.add(error.what());
    file.reset();
  }
}

void RunRecorder::onFrame(const TrackedFrame& tracked, const OdometryOutput& output) {
  writeEvents(output);
  writeKeyframes(output);
  // One line per image with the image's own stamp; the state's stamp is the same instant on the IMU's clock.
  if (!output.has_state) return;
  writeTo(odometry_,
          [&](LineFile& file) { file.write(formatTum(tracked.stamp, output.state.T_world_body)); });
  writeTo(in_map_, [&](InMapFile& file) { file.addFrame(tracked.index, tracked.stamp, output.state); });
}

void RunRecorder::onImuState(const NavState& state) {
  writeTo(imu_rate_, [&](LineFile& file) { file.write(formatTum(state.stamp, state.T_world_body)); });
  if (health_ == state.health && epoch_ == state.epoch) return;
  health_ = state.health;
  epoch_ = state.epoch;
  writeTo(imu_rate_health_, [&](LineFile& file) {
    file.write(fmt::format("{},{},{}", state.stamp.ns, healthName(state.health), state.epoch));
  });
}

void RunRecorder::onMesh(bool keyframe, const LocalMesh& frame, const LocalMesh* horizon,
                         std::span<const Eigen::Vector2f> hull) {
  writeTo(meshes_, [&](MeshSequenceWriter& meshes) { meshes.write(keyframe, frame, horizon, hull); });
}

void RunRecorder::onLocalMesh(const LocalMesh& mesh) {
  if (folder_.empty()) return;
  attempt([&] { writePly(std::filesystem::path(folder_) / "local_mesh.ply", toTriangleMesh(mesh)); });
}

void RunRecorder::onLoop(const LoopReport& report) {
  writeTo(in_map_, [&](InMapFile& file) { file.addReport(report); });
}

void RunRecorder::onPlaces(LoopStage& places) {
  writeTo(in_map_, [](InMapFile& file) { file.finish(); });
  if (!kept_) return;
  KeptGraph graph;
  kept_epochs_ = places.keep(graph);
  attempt([&] { kept_->write(graph); });
}

void RunRecorder::commitMap() {
  if (kept_) attempt([&] { kept_->commit(); });
}

void RunRecorder::onMap(MapStage& map, std::span<const std::uint32_t> tied) {
  const auto kept = [&](std::uint32_t epoch) {
    return std::ranges::find(kept_epochs_, epoch) != kept_epochs_.end();
  };
  if (kept_) attempt([&] { kept_->write(map, kept); });
  if (folder_.empty()) return;
  attempt([&] { map_ = writeMap(folder_, map, tied); });
  if (const std::string problem = unreadProblem(folder_, map.submaps()); !problem.empty()) lost_.add(problem);
}

void RunRecorder::onFinish(const OdometryOutput& output) {
  writeEvents(output);
  writeKeyframes(output);
}

void RunRecorder::onRemark(Stamp stamp, const std::string& text) {
  writeTo(events_, [&](LineFile& file) {
    file.write(fmt::format("{} {} {}", formatSeconds(stamp), kRemarkName, text));
  });
}

void RunRecorder::writeEvents(const OdometryOutput& output) {
  for (const Event& event : output.events) {
    writeTo(events_, [&](LineFile& file) {
      file.write(
          fmt::format("{} {} {}", formatSeconds(event.stamp), eventName(event.kind), valueText(event)));
    });
  }
}

void RunRecorder::writeKeyframes(const OdometryOutput& output) {
  for (const KeyframeState& keyframe : output.left_window) {
    writeTo(states_, [&](LineFile& file) { file.write(statesRow(keyframe)); });
  }
}

}  // namespace swiftlet
