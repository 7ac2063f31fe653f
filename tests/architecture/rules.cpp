#include "tests/architecture/rules.hpp"

#include <filesystem>
#include <regex>
#include <utility>

namespace swiftlet::architecture {
namespace {

/// Direct neighbours; the table closes over them.
RoomTable directNeighbours() {
  const std::set<std::string> world = {"estimator/camera", "estimator/messages"};
  RoomTable table = {
      {"estimator/core", {}},
      {"estimator/geometry", {"estimator/core"}},
      {"estimator/camera", {"estimator/geometry"}},
      {"estimator/messages", {"estimator/geometry"}},
      {"estimator/imu", {"estimator/messages"}},
      {"estimator/frontend", {"estimator/camera", "estimator/imu", "estimator/messages"}},
      {"estimator/smoother", {"estimator/camera", "estimator/imu", "estimator/messages"}},
      {"estimator/odometry", {"estimator/frontend", "estimator/smoother"}},
      {"mesher", world},
      {"mapping/depth", world},
      {"mapping/volume", world},
      {"mapping/surface", {"mapping/volume"}},
      {"mapping/distance", {"mapping/volume"}},
      {"mapping/map", {"mapping/depth", "mapping/distance", "mapping/surface", "mapping/volume"}},
      {"mapping/place", world},
      {"mapping/pose_graph", world},
      {"mapping/loop", {"mapping/place", "mapping/pose_graph"}},
  };
  const std::set<std::string> world_and_imu = {"estimator/camera", "estimator/messages", "estimator/imu"};
  for (const char* driver : {"calibration", "recorded", "simulated", "device", "dds"}) {
    table[std::string("drivers/") + driver] = world_and_imu;
  }
  for (const char* driver : {"serial", "can", "gpio", "timesync", "mavlink"}) {
    table[std::string("drivers/") + driver] = {"drivers/device"};
  }
  table["drivers/input"] = {};
  table["drivers/calibration"].insert("drivers/input");
  table["drivers/image"] = {"drivers/device"};
  table["drivers/v4l2"] = {"drivers/image"};
  table["drivers/gstreamer"] = {"drivers/image"};
  // Topics as cameras, with lenses as they tell them.
  table["drivers/dds"].insert({"drivers/calibration", "drivers/image", "drivers/timesync"});
  // An autopilot's inertial messages come over a serial port like any sensor's.
  table["drivers/serial"].insert("drivers/mavlink");
  // Its errors are those of all files that users give.
  table["drivers/bag"] = {"drivers/calibration", "drivers/device"};
  // Calibration as users have it; a simulated flight is written as a recorded one.
  table["drivers/recorded"].insert({"drivers/bag", "drivers/calibration", "drivers/image"});
  table["drivers/target"] = {"drivers/calibration"};
  table["drivers/simulated"].insert({"drivers/recorded", "drivers/target"});
  return table;
}

/// The program's rooms, each with its direct neighbours in the program. All know the rooms below the program.
RoomTable programNeighbours() {
  return {
      {"realtime", {}},
      {"files", {}},
      {"settings", {}},
      {"supervisor", {"realtime"}},
      {"interfaces", {"supervisor"}},
      {"smoothing", {"files", "interfaces"}},
      {"inputs/log", {"interfaces", "settings"}},
      {"inputs/devices", {"interfaces", "settings"}},
      {"inspection", {"inputs/log"}},
      {"inputs/vocabulary", {"files"}},
      {"graph", {"settings", "smoothing"}},
      {"schedule", {"graph", "inputs/log"}},
      {"outputs/map_files", {"files"}},
      {"outputs/run_folder", {"interfaces", "outputs/map_files", "settings"}},
      {"outputs/recorder", {"interfaces"}},
      {"outputs/autopilot", {"interfaces", "settings"}},
      {"outputs/ros2", {"interfaces", "outputs/map_files", "settings"}},
      {"outputs/page", {"outputs/map_files"}},
      {"outputs/view", {"outputs/page", "outputs/run_folder"}},
      {"runs",
       {"inputs/devices", "inputs/vocabulary", "inspection", "outputs/autopilot", "outputs/recorder",
        "outputs/ros2", "outputs/view", "schedule"}},
      {"lab/evaluation", {"outputs/run_folder"}},
      {"lab/modules", {"inputs/log", "inputs/vocabulary", "lab/evaluation"}},
      {"lab/budget", {"lab/evaluation", "runs"}},
      {"lab/report", {"lab/evaluation", "outputs/view", "smoothing"}},
      {"lab/playback", {"lab/report"}},
      {"lab/campaign", {"lab/report"}},
      {"lab/export", {"lab/evaluation", "outputs/ros2"}},
      {"lab/import", {"files", "interfaces"}},
      {"lab/hil", {"inputs/devices", "lab/budget"}},
      {"lab/calibrate/board", {"files", "inputs/log"}},
      {"lab/calibrate/cameras", {"lab/calibrate/board"}},
      {"lab/calibrate/imu_camera", {"inspection", "lab/calibrate/cameras"}},
      {"lab/calibrate/imu_noise", {"inputs/log"}},
      {"lab/calibrate/check", {"lab/evaluation", "runs"}},
      {"lab/calibrate/page",
       {"lab/calibrate/check", "lab/calibrate/imu_camera", "lab/calibrate/imu_noise", "lab/report"}},
      {"lab/calibrate/guidance", {"lab/calibrate/board", "runs"}},
      {"commands",
       {"lab/calibrate/guidance", "lab/calibrate/page", "lab/campaign", "lab/export", "lab/hil", "lab/import",
        "lab/modules", "lab/playback", "runs"}},
  };
}

RoomTable closed(RoomTable table) {
  for (bool grew = true; grew;) {
    grew = false;
    for (auto& [room, known] : table) {
      const std::set<std::string> before = known;
      for (const std::string& neighbour : before) {
        known.insert(table.at(neighbour).begin(), table.at(neighbour).end());
      }
      grew = grew || known.size() != before.size();
    }
  }
  return table;
}

/// Every room, with all that it may know.
RoomTable wholeTable() {
  RoomTable table = closed(directNeighbours());
  std::set<std::string> below;
  for (const auto& [room, known] : table) below.insert(room);
  for (const auto& [room, known] : closed(programNeighbours())) {
    std::set<std::string>& all = table["firmware_host/" + room];
    all = below;
    for (const std::string& other : known) all.insert("firmware_host/" + other);
  }
  std::set<std::string> all;
  for (const auto& [room, known] : table) all.insert(room);
  table["tests"] = all;
  return table;
}

struct Pattern {
  std::regex expression;
  const char* what;
};

/// Each line's first match of each pattern.
std::vector<Violation> matchLines(const std::string& path, const std::vector<std::string>& lines,
                                  const std::vector<Pattern>& patterns) {
  std::vector<Violation> found;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    for (const Pattern& pattern : patterns) {
      if (std::regex_search(lines[i], pattern.expression)) found.push_back({path, i + 1, pattern.what});
    }
  }
  return found;
}

}  // namespace

const RoomTable& roomTable() {
  static const RoomTable kTable = wholeTable();
  return kTable;
}

std::vector<Violation> checkIncludeDirections(const SourceFile& file) {
  static const std::regex kInclude(R"re(^\s*#\s*include\s+"([^"]+)")re");
  std::vector<Violation> found;
  const std::string room = file.room();
  const auto known = roomTable().find(room);
  if (known == roomTable().end()) return {{file.path, 0, "room '" + room + "' is not in the table"}};
  for (std::size_t i = 0; i < file.code_lines.size(); ++i) {
    std::smatch match;
    if (!std::regex_search(file.code_lines[i], match, kInclude)) continue;
    const std::string target = match[1];
    const std::string target_room = SourceFile{target, {}, {}}.room();
    if (!roomTable().contains(target_room)) {
      found.push_back({file.path, i + 1, "include \"" + target + "\" by its path from the project's root"});
    } else if (target_room != room && !known->second.contains(target_room)) {
      found.push_back({file.path, i + 1, room + " must not know " + target_room + " (" + target + ")"});
    }
  }
  return found;
}

std::vector<Violation> checkFlightPath(const SourceFile& file) {
  static const std::vector<Pattern> kPatterns = {
      {std::regex(
           R"(#\s*include\s*<(mutex|shared_mutex|condition_variable|semaphore|future|latch|barrier)>)"),
       "locks and blocking waits are not for the flight path"},
      {std::regex(R"(#\s*include\s*<thread>)"), "stages own no thread"},
      {std::regex(R"(#\s*include\s*<(chrono|ctime|time\.h|sys/time\.h)>)"),
       "stages read no clock: time is data"},
      {std::regex(R"(#\s*include\s*<(fstream|iostream|filesystem|cstdio|stdio\.h)>)"),
       "stages open no file and print nothing"},
      {std::regex(R"(#\s*include\s*<unordered_(map|set)>|\bstd::unordered_)"),
       "iteration over unordered containers is not deterministic"},
      {std::regex(R"(#\s*include\s*<opencv)"), "OpenCV is for tests, not for the estimator"},
      {std::regex(R"(#\s*include\s*<(random)>|\brand\s*\()"), "use swiftlet::Random: same bytes everywhere"},
      {std::regex(R"(\b(throw|catch|try)\b)"), "faults are values: return a Status"},
      // Placement new is written `new (where) T` and allocates nothing.
      {std::regex(R"(\bnew\b(?!\s*\())"), "no naked new: own memory in the constructor"},
      {std::regex(R"(\bdelete\b(?!\s*[;,]))"), "no naked delete: own memory in the constructor"},
      {std::regex(R"(\b(malloc|calloc|realloc|free|alloca)\s*\()"), "no heap calls"},
      {std::regex(R"(\b(abort|exit|terminate)\s*\()"), "never an abort in flight"},
  };
  return matchLines(file.path, file.code_lines, kPatterns);
}

std::vector<Violation> checkNoLocks(const SourceFile& file) {
  static const std::vector<Pattern> kPatterns = {
      {std::regex(
           R"(#\s*include\s*<(mutex|shared_mutex|condition_variable|semaphore|semaphore\.h|future|latch|barrier)>)"),
       "locks and blocking waits are not for the flight path"},
      {std::regex(
           R"(\bstd::(\w*mutex|condition_variable|lock_guard|unique_lock|scoped_lock|shared_lock|future)|\b(pthread_(mutex|cond|rwlock)_|sem_wait))"),
       "locks and blocking waits are not for the flight path"},
  };
  return matchLines(file.path, file.code_lines, kPatterns);
}

std::vector<Violation> checkHeaderOpening(const SourceFile& file) {
  if (file.lines.empty() || file.lines[0] != "#pragma once") {
    return {{file.path, 1, "a header's first line is #pragma once"}};
  }
  if (file.lines.size() < 2 || !file.lines[1].starts_with("// ")) {
    return {{file.path, 2, "a header's second line begins the comment that says what it is"}};
  }
  return {};
}

std::vector<Violation> checkLength(const SourceFile& file, std::size_t limit) {
  if (file.lines.size() <= limit) return {};
  return {{file.path, file.lines.size(),
           std::to_string(file.lines.size()) + " lines, at most " + std::to_string(limit) + " are readable"}};
}

std::vector<Violation> checkText(const SourceFile& file) {
  // Split so that this file does not break its own rule.
  static const std::vector<Pattern> kPatterns = {
      {std::regex("(^|[^A-Za-z0-9_.}])/(ho"
                  "me|wo"
                  "rk|ro"
                  "ot|t"
                  "mp|Us"
                  "ers|m"
                  "nt)/"),
       "a path of one machine: take it from an option, the environment or the project's root"},
      {std::regex("\\b(TO"
                  "DO|FIX"
                  "ME|XX"
                  "X)\\b"),
       "work left undone belongs in an issue"},
      {std::regex(
           R"(\bstd::(ranges::(unique|remove|remove_if|partition|rotate|search|equal_range|subrange)|views::))"),
       "clang 14, which builds the sanitizers, refuses libstdc++'s subranges and views"},
  };
  return matchLines(file.path, file.lines, kPatterns);
}

std::vector<Violation> checkNamedInList(const SourceFile& file, const std::string& list) {
  const std::string name = std::filesystem::path(file.path).filename().string();
  const std::string::size_type at = list.find(name);
  if (at != std::string::npos) return {};
  return {{file.path, 0, "no CMakeLists.txt above it names this source: it is never built"}};
}

}  // namespace swiftlet::architecture
