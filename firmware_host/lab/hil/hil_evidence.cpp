#include "firmware_host/lab/hil/hil_evidence.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/parse_number.hpp"
#include "estimator/messages/names.hpp"
#include "firmware_host/outputs/run_folder/events_log.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

struct HealthChange {
  Stamp stamp;
  Health health = Health::kInitializing;
  std::uint32_t epoch = 0;
};

/// An unknown word, from another version, counts as failed.
Health healthOf(const std::string& name) { return healthNamed(name).value_or(Health::kFailed); }

Json readJson(const fs::path& path) {
  std::ifstream file(path);
  return file ? Json::parse(file, nullptr, false) : Json();
}

Trajectory readPoses(const fs::path& path) {
  LogCounters counters;
  LogWarnings warnings;
  try {
    return fs::exists(path) ? readTrajectory(path.string(), counters, warnings) : Trajectory();
  } catch (const InputError&) {
    return {};
  }
}

std::vector<HilEvidence::Judged> judged(const Trajectory& poses, const std::vector<HealthChange>& changes) {
  std::vector<HilEvidence::Judged> result;
  for (const TrajectoryPoint& point : poses) {
    HilEvidence::Judged pose{point.stamp, point.T_world_body};
    const auto after = std::ranges::upper_bound(changes, point.stamp, {}, &HealthChange::stamp);
    if (after != changes.begin()) {
      pose.health = std::prev(after)->health;
      pose.epoch = std::prev(after)->epoch;
    }
    result.push_back(pose);
  }
  return result;
}

std::vector<HealthChange> readChanges(const fs::path& path) {
  std::vector<HealthChange> changes;
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line)) {
    const std::size_t first = line.find(',');
    const std::size_t second = line.find(',', first + 1);
    HealthChange change;
    double epoch = 0;
    if (line[0] == '#' || second == std::string::npos ||
        !parseNanoseconds(line.substr(0, first), change.stamp) ||
        !parseDouble(line.substr(second + 1), epoch)) {
      continue;
    }
    change.health = healthOf(line.substr(first + 1, second - first - 1));
    change.epoch = static_cast<std::uint32_t>(epoch);
    changes.push_back(change);
  }
  return changes;
}

std::vector<HilEvidence::Line> readRemarks(const fs::path& path) {
  std::vector<HilEvidence::Line> remarks;
  std::size_t skipped = 0;
  for (const EventLine& line : readEvents(path.string(), &skipped)) {
    if (line.name == kRemarkName) remarks.push_back({line.stamp, line.text});
  }
  return remarks;
}

}  // namespace

HilEvidence readHilEvidence(const std::string& run, const std::string& hil) {
  const fs::path played(hil);
  const fs::path flown(run);
  const Json report = readJson(played / "hil.json");
  if (!report.is_object() || !report.contains("last_image_ns")) {
    throw InputError((played / "hil.json").string(), 0, "", "no report of a replay",
                     "Give the folder written by `swiftlet hil`");
  }
  HilEvidence evidence;
  evidence.faults = FaultTimeline::read((played / "faults.csv").string());
  evidence.first_image = Stamp{report["first_image_ns"].get<std::int64_t>()};
  evidence.last_image = Stamp{report["last_image_ns"].get<std::int64_t>()};
  evidence.complete = report.value("complete", false);
  for (const char* camera : {"camera0", "camera1"}) {
    if (!report.contains(camera)) continue;
    const Json& counters = report[camera];
    evidence.complete = evidence.complete && counters.value("late", 0) + counters.value("slipped", 0) == 0;
  }
  evidence.truth = readPoses(played / "truth.tum");
  evidence.remarks = readRemarks(flown / "events.log");
  const Json summary = readJson(flown / "summary.json");
  std::vector<HealthChange> changes;
  if (summary.is_object() && summary.contains("health")) {
    evidence.finished = summary["run"].value("finished", false);
    for (const Json& change : summary["health"]) {
      changes.push_back({Stamp{change["stamp_ns"].get<std::int64_t>()},
                         healthOf(change["health"].get<std::string>()),
                         change["epoch"].get<std::uint32_t>()});
    }
  }
  evidence.frames = judged(readPoses(flown / "odometry.tum"), changes);
  evidence.states = judged(readPoses(flown / "imu_rate.tum"), readChanges(flown / "imu_rate_health.csv"));
  return evidence;
}

}  // namespace swiftlet
