#pragma once
// Reads as much of a run folder as possible: a missing or damaged file is noted as text and is not a failure.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "drivers/recorded/trajectory_file.hpp"
#include "firmware_host/outputs/map_files/triangle_mesh.hpp"
#include "firmware_host/outputs/run_folder/events_log.hpp"
#include "firmware_host/outputs/run_folder/loops_csv.hpp"
#include "firmware_host/outputs/run_folder/states_csv.hpp"

namespace swiftlet {

/// A file that is missing or could not be read.
struct MissingFile {
  std::string file;
  std::string what;  ///< the problem and what to do
};

struct RunFiles {
  std::string folder;
  std::string name;  ///< name of the folder
  Stamp first_image;
  Stamp last_image;
  Trajectory odometry;  ///< for `swiftlet mesh` and `fuse`: the poses used
  Trajectory imu_rate;  ///< empty without imu_rate.tum
  Trajectory map;
  std::vector<StoredState> states;
  std::vector<EventLine> events;
  std::vector<MapLoop> loops;
  std::optional<TriangleMesh> local_mesh;
  std::optional<TriangleMesh> map_mesh;
  nlohmann::ordered_json summary = nlohmann::ordered_json::object();  ///< always an object
  std::vector<MissingFile> missing;

  /// Seconds since the first image.
  [[nodiscard]] double seconds(Stamp stamp) const { return (stamp - first_image).seconds(); }
  /// The object or value at a path of the summary ("run/log"); null if it is missing.
  [[nodiscard]] const nlohmann::ordered_json& at(const std::string& path) const;
  /// Text or number at a path of the summary; empty if it is missing or of another type.
  [[nodiscard]] std::string text(const std::string& path) const;
  [[nodiscard]] std::optional<double> number(const std::string& path) const;
};

/// InputError if there is no such folder, or if it has no files of a run.
RunFiles readRunFiles(const std::string& folder);

}  // namespace swiftlet
