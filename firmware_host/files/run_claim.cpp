#include "firmware_host/files/run_claim.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string_view>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/recording_format.hpp"
#include "firmware_host/files/whole_file.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

constexpr std::array kRunFiles = {"odometry.tum", "states.csv",    "events.log",          "settings.yaml",
                                  "summary.json", "imu_rate.tum",  "imu_rate_health.csv", "map.tum",
                                  "in_map.tum",   "loops.csv",     "local_mesh.ply",      "map.ply",
                                  "map.glb",      "keyframes.swk", "report.html"};
constexpr std::array kRunFolders = {"meshes", "recording", "estimated_calibration"};
constexpr std::array kMeshFiles = {"complete_mesh.ply", "local_mesh.ply", "summary.json", "trajectory.tum"};
constexpr std::array kMapFiles = {"map.glb", "map.ply", "summary.json", "trajectory.tum"};
constexpr std::array kPlaceFiles = {"places.csv", "summary.json"};
constexpr std::array kCalibrationFiles = {"camchain.yaml", "camchain-imucam.yaml", "imu.yaml", "report.html"};
constexpr std::array kSensorFolders = {"cam0", "cam1", "imu0"};
constexpr const char* kSensorFile = "sensor.yaml";
constexpr std::size_t kNumberDigits = 6;
constexpr std::uint32_t kLargestNumber = 999'999;
/// A board without a battery starts in 1970 or at its image's date; a clock in 2020 or later counts as set.
constexpr int kFirstSetYear = 2020;
constexpr int kTriesForName = 1000;
constexpr const char* kFlightsRemedy = "Make flights.folder writable, or choose another one";

/// Words in the mark, indexed by RunKind.
constexpr std::array kWords = {"replay", "flight", "mesh", "map", "place_list", "calibration"};

constexpr const char* word(RunKind kind) { return kWords[static_cast<std::size_t>(kind)]; }

/// Whether the run writes all output files of the estimator.
constexpr bool isWhole(RunKind kind) { return kind == RunKind::kReplay || kind == RunKind::kFlight; }

bool allDigits(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}

/// Whether the name is `prefix`, digits, `suffix`.
bool isNumbered(std::string_view name, std::string_view prefix, std::string_view suffix) {
  return name.size() > prefix.size() + suffix.size() && name.starts_with(prefix) && name.ends_with(suffix) &&
         allDigits(name.substr(prefix.size(), name.size() - prefix.size() - suffix.size()));
}

bool isRunFile(const std::string& name, RunKind kind) {
  const auto in = [&name](const auto& names) { return std::ranges::find(names, name) != names.end(); };
  if (kind == RunKind::kMesh) return in(kMeshFiles);
  if (kind == RunKind::kPlaceList) return in(kPlaceFiles);
  if (kind == RunKind::kCalibration) return in(kCalibrationFiles);
  return (kind == RunKind::kMap ? in(kMapFiles) : in(kRunFiles)) || isNumbered(name, "map_epoch_", ".ply");
}

/// The first file with a run's name; empty: none.
std::string firstRunFile(const fs::path& folder, RunKind kind) {
  std::string first;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    const bool of_run = isRunFile(name, kind) || (kind == RunKind::kMesh && name == "meshes") ||
                        (isWhole(kind) && std::ranges::find(kRunFolders, name) != kRunFolders.end()) ||
                        (kind == RunKind::kCalibration && fs::exists(entry.path() / kSensorFile, error) &&
                         std::ranges::find(kSensorFolders, name) != kSensorFolders.end());
    if (of_run && (first.empty() || name < first)) first = name;
  }
  return first;
}

/// Removes the files for whose names `ours` returns true.
template <typename Ours>
void removeFiles(const fs::path& folder, const Ours& ours) {
  std::vector<fs::path> found;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (ours(entry.path().filename().string()) && !entry.is_directory(error)) found.push_back(entry.path());
  }
  for (const fs::path& path : found) {
    if (::unlink(path.c_str()) == 0 || errno == ENOENT) continue;
    throw InputError(path.string(), 0, "",
                     std::string("from an earlier run cannot be removed: ") + std::strerror(errno),
                     "Give another folder with --out");
  }
}

/// A recording that is in use belongs to the program that uses it and stays.
void removeRecording(const fs::path& folder) {
  const int lock = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (lock < 0) return;
  const bool in_use = ::flock(lock, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  if (!in_use) {
    try {
      removeFiles(folder, [](const std::string& name) {
        std::uint32_t segment = 0;
        return parseSegmentName(name, segment);
      });
    } catch (...) {
      ::close(lock);
      throw;
    }
  }
  ::close(lock);
  if (in_use) {
    throw InputError(folder.string(), 0, "", "another program is writing or reading this recording",
                     "Give another folder with --out, or wait until that program ends");
  }
  ::rmdir(folder.c_str());  // fails and stays if something else is in it
}

/// Removes the files of calibration_files.hpp.
void removeCalibration(const fs::path& folder) {
  for (const char* sensor : kSensorFolders) {
    removeFiles(folder / sensor, [](const std::string& name) { return name == kSensorFile; });
    ::rmdir((folder / sensor).c_str());
  }
}

void removeEarlierRun(const fs::path& folder, RunKind kind) {
  if (isWhole(kind)) {
    removeRecording(folder / "recording");
    removeMeshes((folder / "meshes").string());
    ::rmdir((folder / "meshes").c_str());
    removeCalibration(folder / "estimated_calibration");
    ::rmdir((folder / "estimated_calibration").c_str());
  }
  if (kind == RunKind::kCalibration) removeCalibration(folder);
  removeFiles(folder, [kind](const std::string& name) { return isRunFile(name, kind); });
}

void makeFolders(const std::string& folder, const char* remedy) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw InputError(folder, 0, "", "cannot create this folder: " + error.message(), remedy);
  }
}

/// Whether the folder has a log's parts. A calibration has folders of the same names.
bool holdsLog(const fs::path& folder, RunKind kind) {
  std::error_code error;
  if (fs::exists(folder / "mav0", error)) return true;
  if (kind != RunKind::kCalibration) return fs::exists(folder / "imu0", error);
  return fs::exists(folder / "imu0/data.csv", error) || fs::exists(folder / "cam0/data.csv", error) ||
         fs::exists(folder / "cam0/data", error);
}

void refuseLog(const fs::path& folder, RunKind kind) {
  const fs::path path = fs::absolute(folder).lexically_normal();
  const bool inside = std::ranges::any_of(path, [](const fs::path& part) { return part == "mav0"; });
  if (!inside && !holdsLog(path, kind)) return;
  throw InputError(folder.string(), 0, "", "is a log, and no run is written into one",
                   "Give another folder with --out");
}

void refuseOthers(const std::string& folder, RunKind kind) {
  constexpr const char* kRemedy =
      "Give another folder with --out; `replay` and `fly` overwrite these files with --replace";
  const std::optional<RunKind> held = runKindOf(folder);
  if (held && (*held != kind || kind == RunKind::kFlight)) {
    throw InputError(folder, 0, "", fmt::format("already holds a {}", word(*held)), kRemedy);
  }
  if (held) return;
  const std::string file = firstRunFile(folder, kind);
  if (file.empty()) return;
  throw InputError(folder, 0, "",
                   fmt::format("holds {} but no mark of a {} ({})", file, word(kind), kRunMark), kRemedy);
}

/// Number in a flight folder's name; empty for any other name.
std::optional<std::uint32_t> flightNumber(const std::string& name) {
  constexpr std::string_view kTime = "_20261123T160412Z";
  const std::string_view digits = std::string_view(name).substr(0, kNumberDigits);
  if (digits.size() != kNumberDigits || !allDigits(digits)) return std::nullopt;
  if (name.size() != kNumberDigits) {
    if (name.size() != kNumberDigits + kTime.size()) return std::nullopt;
    for (std::size_t i = 0; i < kTime.size(); ++i) {
      const char c = name[kNumberDigits + i];
      if (allDigits(kTime.substr(i, 1)) ? !allDigits({&c, 1}) : c != kTime[i]) return std::nullopt;
    }
  }
  return static_cast<std::uint32_t>(std::stoul(std::string(digits)));
}

struct OldFlight {
  std::uint32_t number = 0;
  std::string name;
  auto operator<=>(const OldFlight&) const = default;
};

std::vector<OldFlight> flightsIn(const std::string& parent) {
  std::vector<OldFlight> flights;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(parent, error)) {
    const std::string name = entry.path().filename().string();
    const bool folder = entry.is_directory(error) && !entry.is_symlink(error);
    if (const auto number = flightNumber(name); number && folder) flights.push_back({*number, name});
  }
  std::ranges::sort(flights);
  return flights;
}

bool isClaimed(const fs::path& folder) {
  const int mark = ::open((folder / kRunMark).c_str(), O_RDONLY | O_CLOEXEC);
  if (mark < 0) return true;
  const bool claimed = ::flock(mark, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  ::close(mark);
  return claimed;
}

/// Empty if the system does not tell.
std::optional<std::uint64_t> freeBytes(const std::string& folder) {
  std::error_code error;
  const fs::space_info space = fs::space(folder, error);
  if (error) return std::nullopt;
  return space.available;
}

}  // namespace

std::optional<RunKind> runKindOf(const std::string& folder) {
  std::ifstream file(fs::path(folder) / kRunMark);
  std::string held;
  file >> held;
  const auto* const found = std::ranges::find(kWords, held);
  if (found == kWords.end()) return std::nullopt;
  return static_cast<RunKind>(found - kWords.begin());
}

void refuseRunIn(const std::string& folder, RunKind kind) {
  refuseLog(folder, kind);
  refuseOthers(folder, kind);
}

std::vector<std::string> calibrationFilesIn(const std::string& folder) {
  std::vector<std::string> files;
  for (const char* name : kCalibrationFiles) files.push_back(fs::path(folder) / name);
  for (const char* sensor : kSensorFolders) files.push_back(fs::path(folder) / sensor / kSensorFile);
  return files;
}

RunClaim::RunClaim(const std::string& folder, RunKind kind, bool replace) {
  refuseLog(folder, kind);
  makeFolders(folder, "Give another folder with --out");
  if (!replace) refuseOthers(folder, kind);
  removeEarlierRun(folder, kind);
  const std::string mark = fs::path(folder) / kRunMark;
  writeWholeFile(mark, fmt::format("{}\n", word(kind)));
  mark_ = ::open(mark.c_str(), O_RDONLY | O_CLOEXEC);
  if (mark_ >= 0) (void)::flock(mark_, LOCK_SH | LOCK_NB);
}

RunClaim::~RunClaim() {
  if (mark_ >= 0) ::close(mark_);
}

std::string flightName(std::uint32_t number, std::time_t now) {
  constexpr int kEpochOfTm = 1900;
  constexpr int kLastYear = 9999;
  std::string name = fmt::format("{:0{}}", number, kNumberDigits);
  std::tm utc{};
  if (::gmtime_r(&now, &utc) == nullptr) return name;
  const int year = utc.tm_year + kEpochOfTm;
  if (year < kFirstSetYear || year > kLastYear) return name;
  return name + fmt::format("_{:04}{:02}{:02}T{:02}{:02}{:02}Z", year, utc.tm_mon + 1, utc.tm_mday,
                            utc.tm_hour, utc.tm_min, utc.tm_sec);
}

std::string makeFlightFolder(const std::string& parent, std::time_t now) {
  makeFolders(parent, kFlightsRemedy);
  const std::vector<OldFlight> flights = flightsIn(parent);
  std::uint32_t number = flights.empty() ? 1 : flights.back().number + 1;
  for (int i = 0; i < kTriesForName && number <= kLargestNumber; ++i, ++number) {
    const std::string folder = fs::path(parent) / flightName(number, now);
    // Creating the folder is the claim: if two programs try the same name, one of them gets EEXIST.
    if (::mkdir(folder.c_str(), 0755) == 0) return folder;
    if (errno != EEXIST) {
      throw InputError(folder, 0, "",
                       std::string("cannot create the flight's folder: ") + std::strerror(errno),
                       kFlightsRemedy);
    }
  }
  throw InputError(parent, 0, "", "all flight numbers are used", "Set flights.folder to another folder");
}

std::vector<std::string> freeOldFlights(const std::string& parent, std::uint64_t bytes,
                                        const std::string& current) {
  constexpr std::uint64_t kMebibyte = 1U << 20U;
  std::vector<std::string> lines;
  std::optional<std::uint64_t> available = freeBytes(parent);
  for (const OldFlight& flight : flightsIn(parent)) {
    if (!available || *available >= bytes) break;
    const fs::path folder = fs::path(parent) / flight.name;
    std::error_code error;
    if (fs::equivalent(folder, current, error)) continue;
    if (runKindOf(folder.string()) != RunKind::kFlight || isClaimed(folder)) continue;
    fs::remove_all(folder, error);
    available = freeBytes(parent);
    lines.push_back(
        error ? fmt::format("{}: cannot be deleted to free disk space: {}", folder.string(), error.message())
              : fmt::format("{}: deleted to free disk space (flights.keep_free_mib)", folder.string()));
  }
  if (available && *available < bytes) {
    lines.push_back(
        fmt::format("{}: {} MiB free, flights.keep_free_mib requires {}, and no older flight can be deleted",
                    parent, *available / kMebibyte, bytes / kMebibyte));
  }
  return lines;
}

void removeMeshes(const std::string& folder) {
  removeFiles(folder, [](const std::string& name) {
    return name == "frames.csv" || isNumbered(name, "frame_", ".ply") || isNumbered(name, "horizon_", ".ply");
  });
}

}  // namespace swiftlet
