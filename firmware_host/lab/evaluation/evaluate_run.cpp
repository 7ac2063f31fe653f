#include "firmware_host/lab/evaluation/evaluate_run.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "drivers/bag/bag_file.hpp"
#include "drivers/input/file_tree.hpp"
#include "drivers/recorded/bag_topics.hpp"
#include "drivers/recorded/open_log.hpp"
#include "firmware_host/lab/evaluation/accuracy_report.hpp"
#include "firmware_host/outputs/run_folder/loops_csv.hpp"
#include "firmware_host/outputs/run_folder/states_csv.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

/// Accuracy of one file over the whole flight and from the common start.
Json sectionsJson(const Trajectory& estimate, const Trajectory& truth, Stamp first_image,
                  const EvaluationGroup& settings) {
  Json json;
  for (const AlignKind align : {AlignKind::kSe3, AlignKind::kYaw}) {
    AccuracyOptions options = accuracyOptions(settings, align);
    json["all"][std::string(alignName(align))] = toJson(accuracyOf(estimate, truth, options));
    options.association.from = first_image + Duration::fromSeconds(kCommonStart);
    json["from_3s"][std::string(alignName(align))] = toJson(accuracyOf(estimate, truth, options));
  }
  return json;
}

}  // namespace

AccuracyOptions accuracyOptions(const EvaluationGroup& settings, AlignKind align) {
  AccuracyOptions options;
  options.align = align;
  options.association.max_gap = Duration::fromSeconds(settings.max_gap_ms * 1e-3);
  options.rpe_delta = Duration::fromSeconds(settings.rpe_delta_s);
  return options;
}

Truth readTruth(const std::string& path, bool without_images) {
  Truth truth;
  constexpr const char* kRemedy = "Give a trajectory file with --truth (TUM, or EuRoC csv)";
  if (isBag(path)) {
    // Reading only poses needs no calibration, which a bag does not have.
    const auto bag = openBag(path);
    const auto topic = chooseTruthTopic(*bag);
    truth.poses = readBagTruth(*bag, topic, truth.warnings);
    if (truth.poses.empty()) throw InputError(path, 0, "", "none of its topics has true poses", kRemedy);
    truth.name = path + " " + bag->topics()[*topic].name;
    return truth;
  }
  if (!std::filesystem::is_directory(path) && !isArchive(path)) {
    truth.poses = readEstimate(path, truth.warnings);
    truth.name = path;
    return truth;
  }
  LogOptions options;
  options.without_images = without_images;
  const auto source = openLog(path, options);
  truth.poses = source->groundTruth(truth.warnings);
  truth.name = source->groundTruthName();
  if (truth.poses.empty()) {
    throw InputError(path, 0, "", "the log has no truth", kRemedy);
  }
  SensorMessage message;
  while (!without_images && !truth.first_image && source->next(message)) {
    if (const auto* frame = std::get_if<CameraFrame>(&message)) truth.first_image = frame->stamp;
  }
  return truth;
}

Trajectory readEstimate(const std::string& path, LogWarnings& warnings) {
  LogCounters counters;
  Trajectory trajectory = readTrajectory(path, counters, warnings);
  warnOfRows(path, counters, warnings);
  return trajectory;
}

Trajectory readEstimate(const std::string& path) {
  LogWarnings unused;
  return readEstimate(path, unused);
}

void warnOfRows(const std::string& file, const LogCounters& counters, LogWarnings& warnings) {
  const std::uint64_t rows = counters.bad_rows + counters.nan_rows + counters.repeated_stamps;
  if (rows > 0) warnings.add(fmt::format("{}: {} rows are left out of the comparison", file, rows));
}

Consistency consistencyOf(const std::string& states_file, const Trajectory& truth,
                          const AssociationOptions& options) {
  std::vector<ConsistencySample> samples;
  for (const StoredState& state : readStates(states_file)) {
    if (!options.inSection(state.stamp)) continue;
    const std::optional<SE3> pose = interpolate(truth, state.stamp, options.max_gap);
    if (pose) samples.push_back({state.T_world_body, *pose, state.covariance});
  }
  return consistency(samples);
}

Revisits revisitsOf(const Trajectory& estimate, const Trajectory& truth, const AssociationOptions& section) {
  Trajectory flown;
  for (const TrajectoryPoint& point : truth) {
    if (point.stamp < estimate.front().stamp || point.stamp > estimate.back().stamp) continue;
    if (section.inSection(point.stamp)) flown.push_back(point);
  }
  return countRevisits(flown);
}

Json runAccuracyJson(const std::string& folder, const Trajectory& truth, const std::string& truth_name,
                     Stamp first_image, const EvaluationGroup& settings) {
  const std::filesystem::path path(folder);
  Json json;
  json["truth"] = truth_name;
  const Trajectory odometry = readEstimate(path / "odometry.tum");
  json["odometry"] = sectionsJson(odometry, truth, first_image, settings);
  // A run of a few frames has no keyframe with a state that left the window.
  Trajectory states;
  try {
    states = readEstimate(path / "states.csv");
  } catch (const InputError&) {
    json["states"] = nullptr;
  }
  if (!states.empty()) {
    json["states"] = sectionsJson(states, truth, first_image, settings);
    json["consistency"] = toJson(
        consistencyOf(path / "states.csv", truth, accuracyOptions(settings, AlignKind::kSe3).association));
  }
  if (std::filesystem::exists(path / "map.tum")) {
    const Trajectory map = readEstimate(path / "map.tum");
    json["map"] = sectionsJson(map, truth, first_image, settings);
    AccuracyOptions options = accuracyOptions(settings, AlignKind::kSe3);
    json["map_beside_odometry"]["all"] = toJson(compareAtCommonStamps(odometry, map, truth, options));
    options.association.from = first_image + Duration::fromSeconds(kCommonStart);
    json["map_beside_odometry"]["from_3s"] = toJson(compareAtCommonStamps(odometry, map, truth, options));
  }
  if (std::filesystem::exists(path / "loops.csv")) {
    json["loops"] = toJson(loopAccuracy(readLoops(path / "loops.csv"), truth,
                                        accuracyOptions(settings, AlignKind::kSe3).association));
  }
  json["revisits"] = toJson(revisitsOf(odometry, truth));
  return json;
}

}  // namespace swiftlet
