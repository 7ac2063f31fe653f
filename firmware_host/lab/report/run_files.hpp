#pragma once
// What a run folder holds, read as far as it can be: a file that is missing or damaged is a line of text and
// not a failure.

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

/// A file that should be there, or that could not be read as it is.
struct MissingFile {
  std::string file;
  std::string what;  ///< and what to do
};

struct RunFiles {
  std::string folder;
  std::string name;  ///< the folder's own
  Stamp first_image;
  Stamp last_image;
  Trajectory odometry;  ///< of `swiftlet mesh` and `fuse`: the poses used
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
  /// The object or value at a path of the summary ("run/log"); null when there is none.
  [[nodiscard]] const nlohmann::ordered_json& at(const std::string& path) const;
  /// Text or number at a path of the summary; the default when it is missing or of another kind.
  [[nodiscard]] std::string text(const std::string& path) const;
  [[nodiscard]] std::optional<double> number(const std::string& path) const;
};

/// InputError when there is no such folder, or nothing of a run in it.
RunFiles readRunFiles(const std::string& folder);

}  // namespace swiftlet
