// Cold starts in a kept map, as rows of docs/experiments/accuracy_loops.md.
//
//   relocalization_table FLIGHT...               the map: each flight's first half; starts: in the rest
//   relocalization_table --map FLIGHT FLIGHT...  the map: all of one flight; starts: in others of its world
//
// A start every 2 s. --out FOLDER keeps the run folders.
//
// A start counts as one that could be located where for half of its first 3 s the view is within 1 m and 30
// degrees of a node of the map, by the truth. Errors are those of in_map.tum in the map's frame, which the
// nodes of the map tie to the truth (SE(3)).

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/open_log.hpp"
#include "drivers/recorded/trajectory_file.hpp"
#include "estimator/core/units.hpp"
#include "estimator/geometry/alignment.hpp"
#include "firmware_host/lab/evaluation/association.hpp"
#include "firmware_host/outputs/map_files/kept_folder.hpp"
#include "firmware_host/runs/replay_run.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

constexpr double kStartEvery = 2;    // s
constexpr double kFlown = 10;        // s of each start
constexpr double kInTime = 3;        // s
constexpr double kNearDistance = 1;  // m
constexpr double kNearTurn = 30 / kToDegrees;
constexpr double kWrongDistance = 0.5;  // m: no error of a right location
constexpr double kWrongTurn = 5 / kToDegrees;
constexpr double kKeptLongest = 5;  // s
constexpr double kSample = 0.1;     // s
const Duration kTruthGap = Duration::fromMilliseconds(20);

struct Log {
  std::string path;
  Trajectory truth;
  Stamp first;
  double seconds = 0;
};

Log openFlight(const std::string& path) {
  const std::unique_ptr<LogSource> source = openLog(path);
  Log log{path, source->groundTruth(), {}, 0};
  if (log.truth.empty()) throw InputError(path, 0, "", "has no truth", "Name a flight with truth");
  SensorMessage message;
  while (source->next(message)) {
    if (const auto* frame = std::get_if<CameraFrame>(&message); frame != nullptr) {
      log.first = frame->stamp;
      break;
    }
  }
  log.seconds = (log.truth.back().stamp - log.first).seconds();
  return log;
}

void fly(const std::string& log, const fs::path& out, double from, double until, KeptMapRequest maps) {
  ReplayRequest request;
  request.log = log;
  request.out = out.string();
  request.from = from;
  request.until = until;
  request.kept_maps = std::move(maps);
  Settings settings;
  settings.mesh.enabled = false;
  settings.full_smoothing = false;
  static_cast<void>(runReplay(request, settings));
}

/// A kept map beside the truth of the flight that made it.
struct Map {
  std::string folder;
  std::vector<SE3> T_truth_node;
  SE3 T_truth_map;
  double rms = 0;  ///< m, of its nodes

  [[nodiscard]] bool near(const SE3& T_truth_body) const {
    return std::any_of(T_truth_node.begin(), T_truth_node.end(), [&](const SE3& node) {
      return (node.translation - T_truth_body.translation).norm() < kNearDistance &&
             node.rotation.angularDistance(T_truth_body.rotation) < kNearTurn;
    });
  }
};

Map makeMap(const Log& log, const fs::path& out, const std::string& name, double until) {
  Map map;
  map.folder = (out / (name + "_kept")).string();
  fs::remove_all(map.folder);
  fly(log.path, out / (name + "_map"), 0, until, {map.folder, "", false});
  const KeptGraph graph = readKeptFolder(map.folder);
  std::vector<Eigen::Vector3d> found, truth;
  for (const KeptNode& node : graph.nodes) {
    const auto pose = interpolate(log.truth, node.stamp, kTruthGap);
    if (!pose) continue;
    map.T_truth_node.push_back(*pose);
    found.push_back(node.T_map_body.translation);
    truth.push_back(pose->translation);
  }
  Alignment alignment;
  if (!alignRigid(found, truth, alignment).ok()) {
    throw InputError(log.path, 0, "", "its map cannot be laid over its truth", "Let it fly farther");
  }
  map.T_truth_map = alignment.T_to_from;
  map.rms = alignment.rms;
  return map;
}

struct Start {
  bool could = false;
  double located_after = -1;  ///< s; below 0: never
  double longest_wrong = 0;   ///< s
  double squares = 0;         ///< m^2, of lines that are not wrong
  std::size_t lines = 0;
  double near_squares = 0;  ///< of these, where the view is near one of the map
  std::size_t near_lines = 0;
};

double rms(double squares, std::size_t lines) {
  return lines > 0 ? std::sqrt(squares / static_cast<double>(lines)) : 0;
}

Start judge(const Log& log, const Map& map, double from, const Trajectory& found) {
  Start start;
  const Stamp begin = log.first + Duration::fromSeconds(from);
  int near = 0, samples = 0;
  for (double t = 0; t < kInTime; t += kSample) {
    const auto pose = interpolate(log.truth, begin + Duration::fromSeconds(t), kTruthGap);
    if (!pose) continue;
    ++samples;
    near += map.near(*pose) ? 1 : 0;
  }
  start.could = samples > 0 && 2 * near >= samples;
  bool wrong_now = false;
  Stamp wrong_since;
  for (const TrajectoryPoint& line : found) {
    const auto pose = interpolate(log.truth, line.stamp, kTruthGap);
    if (!pose) continue;
    if (start.located_after < 0) start.located_after = (line.stamp - begin).seconds();
    const SE3 placed = map.T_truth_map * line.T_world_body;
    const double distance = (placed.translation - pose->translation).norm();
    const bool wrong =
        distance > kWrongDistance || placed.rotation.angularDistance(pose->rotation) > kWrongTurn;
    if (wrong && !wrong_now) wrong_since = line.stamp;
    wrong_now = wrong;
    if (wrong) {
      start.longest_wrong = std::max(start.longest_wrong, (line.stamp - wrong_since).seconds() + kSample);
    } else {
      start.squares += distance * distance;
      ++start.lines;
      if (!map.near(*pose)) continue;
      start.near_squares += distance * distance;
      ++start.near_lines;
    }
  }
  return start;
}

void printRow(const std::string& name, const Map& map, const std::vector<Start>& starts) {
  std::vector<double> after;
  std::size_t could = 0, in_time = 0, located = 0, wrong = 0, kept_wrong = 0, lines = 0, near_lines = 0;
  double squares = 0, near_squares = 0;
  for (const Start& start : starts) {
    const bool quick = start.located_after >= 0 && start.located_after <= kInTime;
    could += start.could ? 1 : 0;
    in_time += start.could && quick ? 1 : 0;
    located += start.located_after >= 0 ? 1 : 0;
    wrong += start.longest_wrong > 0 ? 1 : 0;
    kept_wrong += start.longest_wrong > kKeptLongest ? 1 : 0;
    squares += start.squares;
    lines += start.lines;
    near_squares += start.near_squares;
    near_lines += start.near_lines;
    if (start.located_after >= 0) after.push_back(start.located_after);
  }
  std::sort(after.begin(), after.end());
  const double median = after.empty() ? 0 : after[after.size() / 2];
  fmt::print("| {} | {} | {} | {} | {} | {:.2f} | {} | {} | {:.4f} | {:.4f} | {:.4f} |\n", name,
             starts.size(), could, in_time, located, median, wrong, kept_wrong, rms(squares, lines),
             rms(near_squares, near_lines), map.rms);
  std::fflush(stdout);
}

void flyInto(const Log& log, const Map& map, double from, const std::string& name, const fs::path& out) {
  std::vector<Start> starts;
  LogCounters counters;
  LogWarnings warnings;
  for (double t = from; t + kInTime < log.seconds; t += kStartEvery) {
    const fs::path run = out / fmt::format("{}_{:g}", name, t);
    fly(log.path, run, t, t + kFlown, {"", map.folder, false});
    const fs::path lines = run / "in_map.tum";
    const Trajectory found =
        fs::file_size(lines) > 0 ? readTrajectory(lines.string(), counters, warnings) : Trajectory{};
    starts.push_back(judge(log, map, t, found));
    const Start& start = starts.back();
    fmt::print(stderr, "{} {:5.1f} s: {}, located after {:.2f} s, wrong for {:.2f} s, rms {:.4f} m\n", name,
               t, start.could ? "could be" : "-", start.located_after, start.longest_wrong,
               rms(start.squares, start.lines));
  }
  printRow(name, map, starts);
}

}  // namespace
}  // namespace swiftlet

int main(int argc, char** argv) {
  using namespace swiftlet;
  CLI::App app("Cold starts in a kept map");
  std::vector<std::string> flights;
  std::string map_flight;
  std::string out;
  app.add_option("FLIGHT", flights, "Folders with truth")->required();
  app.add_option("--map", map_flight, "The flight that makes the map; default: the first half of each");
  app.add_option("--out", out, "Keep the run folders here");
  CLI11_PARSE(app, argc, argv);
  const fs::path folder =
      out.empty() ? fs::temp_directory_path() / fmt::format("swiftlet_relocalization_{}", getpid())
                  : fs::path(out);
  fs::create_directories(folder);
  const auto nameOf = [](const std::string& path) { return fs::path(path).filename().string(); };
  try {
    std::optional<Map> given;
    if (!map_flight.empty()) {
      const Log log = openFlight(map_flight);
      given = makeMap(log, folder, nameOf(map_flight), log.seconds);
    }
    for (const std::string& flight : flights) {
      const Log log = openFlight(flight);
      const double cut = given ? 0 : log.seconds / 2;
      const Map map = given ? *given : makeMap(log, folder, nameOf(flight), cut);
      flyInto(log, map, cut, nameOf(flight), folder);
    }
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 2;
  }
  std::error_code ignored;
  if (out.empty()) fs::remove_all(folder, ignored);
  return 0;
}
