#include "firmware_host/lab/report/run_files.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "drivers/input/input_error.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// Reads the files of one folder and notes errors.
class FolderReader {
 public:
  explicit FolderReader(RunFiles& files) : files_(&files), folder_(files.folder) {}

  [[nodiscard]] bool has(const char* name) const { return fs::exists(folder_ / name); }
  [[nodiscard]] int found() const { return found_; }

  void note(const char* name, const std::string& what) { files_->missing.push_back({name, what}); }

  /// `wanted`: what the report lacks without the file; null: the file is optional.
  template <typename Value, typename Read>
  void read(const char* name, const char* wanted, Value& value, const Read& reader) {
    if (!has(name)) {
      if (wanted != nullptr) note(name, std::string("is missing: the report has no ") + wanted);
      return;
    }
    ++found_;
    try {
      value = reader((folder_ / name).string());
    } catch (const std::exception& error) {
      note(name, error.what());
    }
  }

  Trajectory trajectory(const char* name, const std::string& path) {
    LogCounters counters;
    LogWarnings warnings;
    Trajectory poses = readTrajectory(path, counters, warnings);
    const auto bad = counters.bad_rows + counters.nan_rows;
    if (bad > 0) {
      note(name, std::to_string(bad) + " damaged rows were left out; the first: " + firstOf(warnings));
    }
    return poses;
  }

 private:
  static std::string firstOf(const LogWarnings& warnings) {
    return warnings.lines().empty() ? "unnamed" : warnings.lines().front();
  }

  RunFiles* files_;
  fs::path folder_;
  int found_ = 0;
};

Json readJsonObject(const std::string& path) {
  std::ifstream file(path);
  Json json = Json::parse(file, nullptr, false);
  if (!json.is_object()) {
    throw InputError(path, 0, "", "not a valid JSON object",
                     "Replay again; without it the report has no settings, counters, latencies and memory");
  }
  return json;
}

/// Finds the flight's first and last stamp, from the summary or else from the files.
void findBounds(RunFiles& files) {
  std::vector<Stamp> stamps;
  for (const Trajectory* poses : {&files.odometry, &files.map}) {
    if (poses->empty()) continue;
    stamps.push_back(poses->front().stamp);
    stamps.push_back(poses->back().stamp);
  }
  if (!files.states.empty()) {
    stamps.push_back(files.states.front().stamp);
    stamps.push_back(files.states.back().stamp);
  }
  for (const EventLine& event : files.events) stamps.push_back(event.stamp);
  if (!stamps.empty()) {
    files.first_image = *std::ranges::min_element(stamps);
    files.last_image = *std::ranges::max_element(stamps);
  }
  const Json& first = files.at("run/first_image_ns");
  const Json& last = files.at("run/last_image_ns");
  if (first.is_number_integer()) files.first_image = Stamp{first.get<std::int64_t>()};
  if (last.is_number_integer()) files.last_image = Stamp{last.get<std::int64_t>()};
}

}  // namespace

const Json& RunFiles::at(const std::string& path) const {
  static const Json kNull;
  const Json::json_pointer pointer("/" + path);
  return summary.contains(pointer) ? summary.at(pointer) : kNull;
}

std::string RunFiles::text(const std::string& path) const {
  const Json& json = at(path);
  return json.is_string() ? json.get<std::string>() : std::string();
}

std::optional<double> RunFiles::number(const std::string& path) const {
  const Json& json = at(path);
  if (!json.is_number()) return {};
  return json.get<double>();
}

RunFiles readRunFiles(const std::string& folder) {
  if (!fs::is_directory(folder)) {
    throw InputError(folder, 0, "", "no such folder", "Give a folder that replay, fly, mesh or fuse wrote");
  }
  RunFiles files;
  files.folder = folder;
  fs::path path(folder);
  if (!path.has_filename()) path = path.parent_path();
  files.name = fs::weakly_canonical(path).filename().string();
  FolderReader reader(files);
  // A folder of `mesh` or `fuse` has the given poses, and neither odometry nor states.
  const bool given = !reader.has("odometry.tum") && reader.has("trajectory.tum");
  const char* poses = given ? "trajectory.tum" : "odometry.tum";
  const auto trajectory = [&](const char* name) {
    return [&reader, name](const std::string& file) { return reader.trajectory(name, file); };
  };
  reader.read("summary.json", "settings, counters, health history, latencies and memory", files.summary,
              readJsonObject);
  reader.read(poses, "trajectory and error", files.odometry, trajectory(poses));
  reader.read("imu_rate.tum", nullptr, files.imu_rate, trajectory("imu_rate.tum"));
  reader.read("map.tum", nullptr, files.map, trajectory("map.tum"));
  reader.read("states.csv", given ? nullptr : "velocity, biases, covariance, features and residuals",
              files.states, readStates);
  std::size_t skipped = 0;
  reader.read("events.log", given ? nullptr : "events", files.events,
              [&](const std::string& file) { return readEvents(file, &skipped); });
  if (skipped > 0)
    reader.note("events.log", std::to_string(skipped) + " lines without a stamp were left out");
  reader.read("loops.csv", nullptr, files.loops, readLoops);
  reader.read("local_mesh.ply", nullptr, files.local_mesh, readPly);
  reader.read("map.ply", nullptr, files.map_mesh, readPly);
  if (reader.found() == 0) {
    throw InputError(folder, 0, "", "holds no file of a run",
                     "Give a folder that replay, fly, mesh or fuse wrote");
  }
  findBounds(files);
  return files;
}

}  // namespace swiftlet
