#include "firmware_host/lab/export/tum_files.hpp"

#include <algorithm>
#include <filesystem>

#include "drivers/input/input_error.hpp"
#include "firmware_host/files/whole_file.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

void makeFolder(const fs::path& folder, const fs::path& run) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw InputError(folder, 0, "", "the folder cannot be made: " + error.message(),
                     "Give another one with --tum");
  }
  if (fs::equivalent(folder, run, error)) {
    throw InputError(folder, 0, "", "is the run folder itself", "Give another folder with --tum");
  }
  for (const char* mark : {"swiftlet_run.txt", "summary.json"}) {
    if (!fs::exists(folder / mark)) continue;
    throw InputError(folder, 0, mark, "belongs to another run, whose trajectories would be overwritten",
                     "Give another folder with --tum");
  }
}

}  // namespace

std::vector<std::string> writeTumFiles(const RunFolder& run, const Trajectory& truth,
                                       const std::string& folder) {
  const fs::path from(run.path);
  const fs::path to(folder);
  makeFolder(to, from);
  std::error_code error;
  std::vector<std::string> written;
  const auto copy = [&](const std::string& name, const Trajectory& read) {
    if (read.empty()) return;
    const std::string part = to / (name + ".part");
    fs::copy_file(from / name, part, fs::copy_options::overwrite_existing, error);
    if (error) {
      std::error_code ignored;
      fs::remove(part, ignored);
      throw InputError(to / name, 0, "", "cannot be written: " + error.message(),
                       "Is the folder writable and the disk not full?");
    }
    commitPart(part, to / name);
    written.push_back(name);
  };
  copy(run.odometry_file, run.odometry);
  copy("imu_rate.tum", run.imu_rate);
  copy("map.tum", run.map);
  if (!run.keyframes.empty()) {
    WholeFile file(to / "keyframes.tum");
    for (const KeyframeState& keyframe : run.keyframes) {
      file.write(formatTum(keyframe.state.stamp, keyframe.state.T_world_body) + "\n");
    }
    file.commit();
    written.emplace_back("keyframes.tum");
  }
  if (!truth.empty()) {
    WholeFile file(to / "truth.tum");
    for (const TrajectoryPoint& point : truth) {
      file.write(formatTum(point.stamp, point.T_world_body) + "\n");
    }
    file.commit();
    written.emplace_back("truth.tum");
  }
  for (const char* name :
       {"odometry.tum", "trajectory.tum", "imu_rate.tum", "map.tum", "keyframes.tum", "truth.tum"}) {
    if (std::ranges::find(written, name) == written.end()) fs::remove(to / name, error);
  }
  return written;
}

}  // namespace swiftlet
