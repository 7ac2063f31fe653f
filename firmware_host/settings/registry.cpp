#include "firmware_host/settings/registry.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <vector>

#include "drivers/input/edit_distance.hpp"
#include "estimator/core/limits.hpp"
#include "firmware_host/settings/setting_makers.hpp"

namespace swiftlet {
namespace {

/// Highest SCHED_FIFO priority for settings; the kernel's own threads have 99.
constexpr int kHighestPriority = 98;
/// Highest CPU in glibc's fixed CPU sets.
constexpr int kHighestCpu = 1023;
/// Budgets in milliseconds; a longer one makes no sense for a flight estimator.
constexpr double kLongestBudget = 10'000;
constexpr double kShortestBudget = 0.001;

IntegerSetting priority(int RealtimeGroup::*value) {
  return integer(&Settings::realtime, value, 0, kHighestPriority);
}

IntegerSetting cpu(int RealtimeGroup::*value) { return integer(&Settings::realtime, value, -1, kHighestCpu); }

std::vector<Setting> realtimeSettings() {
  using R = RealtimeGroup;
  return {
      {"realtime.enabled", "",
       "Request the thread priorities and CPUs below. Without the permission for them the run continues with "
       "normal scheduling and prints a warning.",
       onOff(&Settings::realtime, &R::enabled)},
      {"realtime.lock_memory", "",
       "Lock all memory (mlockall) before arming, so that page faults cannot delay a thread.",
       onOff(&Settings::realtime, &R::lock_memory)},
      {"realtime.sensor_priority", "",
       "SCHED_FIFO priority of the threads that read devices; 0: normal scheduling (SCHED_OTHER). PREEMPT_RT "
       "kernels run interrupt handlers at 50: stay below. Priorities should decrease from sensor_priority to "
       "low_priority.",
       priority(&R::sensor_priority)},
      {"realtime.propagate_priority", "",
       "SCHED_FIFO priority of the thread that propagates every IMU sample; 0: SCHED_OTHER.",
       priority(&R::propagate_priority)},
      {"realtime.track_priority", "",
       "SCHED_FIFO priority of the thread that pairs and tracks images; 0: SCHED_OTHER.",
       priority(&R::track_priority)},
      {"realtime.smooth_priority", "", "SCHED_FIFO priority of the smoother's thread; 0: SCHED_OTHER.",
       priority(&R::smooth_priority)},
      {"realtime.mesh_priority", "", "SCHED_FIFO priority of the local mesh's thread; 0: SCHED_OTHER.",
       priority(&R::mesh_priority)},
      {"realtime.low_priority", "",
       "SCHED_FIFO priority of the threads for map, loop closure, recorder and reports; 0: SCHED_OTHER.",
       priority(&R::low_priority)},
      {"realtime.sensor_cpu", "", "CPU on which the threads that read devices run; -1: any.",
       cpu(&R::sensor_cpu)},
      {"realtime.propagate_cpu", "", "CPU on which the propagation thread runs; -1: any.",
       cpu(&R::propagate_cpu)},
      {"realtime.track_cpu", "", "CPU on which the tracking thread runs; -1: any.", cpu(&R::track_cpu)},
      {"realtime.smooth_cpu", "", "CPU on which the smoother's thread runs; -1: any.", cpu(&R::smooth_cpu)},
      {"realtime.mesh_cpu", "", "CPU on which the mesh thread runs; -1: any.", cpu(&R::mesh_cpu)},
      {"realtime.low_cpu", "",
       "CPU on which the threads for map, loop closure, recorder and reports run; -1: any.",
       cpu(&R::low_cpu)},
  };
}

RealSetting budget(double BudgetsGroup::*value) {
  return real(&Settings::budgets, value, kShortestBudget, kLongestBudget);
}

std::vector<Setting> budgetSettings() {
  using B = BudgetsGroup;
  constexpr double kWidestSpread = 100;
  return {
      {"budgets.propagate_p50_ms", "ms",
       "Allowed CPU time of a propagation step, median. `swiftlet budget` fails above it.",
       budget(&B::propagate_p50_ms)},
      {"budgets.propagate_p99_ms", "ms", "Allowed CPU time of a propagation step, 99th percentile.",
       budget(&B::propagate_p99_ms)},
      {"budgets.propagate_max_ms", "ms", "Allowed CPU time of a propagation step, maximum.",
       budget(&B::propagate_max_ms)},
      {"budgets.track_p50_ms", "ms", "Allowed CPU time of a tracking step, keyframes included, median.",
       budget(&B::track_p50_ms)},
      {"budgets.track_p99_ms", "ms",
       "Allowed CPU time of a tracking step, keyframes included, 99th percentile.", budget(&B::track_p99_ms)},
      {"budgets.track_max_ms", "ms", "Allowed CPU time of a tracking step, keyframes included, maximum.",
       budget(&B::track_max_ms)},
      {"budgets.smooth_p50_ms", "ms", "Allowed CPU time of a smoother step, median.",
       budget(&B::smooth_p50_ms)},
      {"budgets.smooth_p99_ms", "ms", "Allowed CPU time of a smoother step, 99th percentile.",
       budget(&B::smooth_p99_ms)},
      {"budgets.smooth_max_ms", "ms", "Allowed CPU time of a smoother step, maximum.",
       budget(&B::smooth_max_ms)},
      {"budgets.mesh_p50_ms", "ms", "Allowed CPU time of a mesher step, keyframes included, median.",
       budget(&B::mesh_p50_ms)},
      {"budgets.mesh_p99_ms", "ms", "Allowed CPU time of a mesher step, keyframes included, 99th percentile.",
       budget(&B::mesh_p99_ms)},
      {"budgets.mesh_max_ms", "ms", "Allowed CPU time of a mesher step, keyframes included, maximum.",
       budget(&B::mesh_max_ms)},
      {"budgets.image_to_pose_p50_ms", "ms",
       "Allowed CPU time of all stages from a frame's images to its pose, median.",
       budget(&B::image_to_pose_p50_ms)},
      {"budgets.image_to_pose_p99_ms", "ms",
       "Allowed CPU time of all stages from a frame's images to its pose, 99th percentile.",
       budget(&B::image_to_pose_p99_ms)},
      {"budgets.image_to_pose_max_ms", "ms",
       "Allowed CPU time of all stages from a frame's images to its pose, maximum.",
       budget(&B::image_to_pose_max_ms)},
      {"budgets.image_to_pose_spread", "",
       "Allowed ratio of the 99th percentile to the median of the CPU time from images to pose. Checked "
       "separately for keyframes and for other frames.",
       real(&Settings::budgets, &B::image_to_pose_spread, 1, kWidestSpread)},
      {"budgets.image_to_pose_wall_p99_ms", "ms",
       "Allowed wall time from the arrival of a frame's last image to its published pose, 99th percentile. "
       "Includes the machine's own scheduling delay, which the bare timer loop in the same report shows.",
       budget(&B::image_to_pose_wall_p99_ms)},
      {"budgets.image_to_pose_wall_max_ms", "ms",
       "Allowed wall time from the arrival of a frame's last image to its published pose, maximum.",
       budget(&B::image_to_pose_wall_max_ms)},
      {"budgets.sample_to_state_p50_ms", "ms",
       "Allowed CPU time from an IMU sample to its published state, median.",
       budget(&B::sample_to_state_p50_ms)},
      {"budgets.sample_to_state_p99_ms", "ms",
       "Allowed CPU time from an IMU sample to its published state, 99th percentile.",
       budget(&B::sample_to_state_p99_ms)},
      {"budgets.sample_to_state_wall_p99_ms", "ms",
       "Allowed wall time from an IMU sample's arrival to its published state, 99th percentile.",
       budget(&B::sample_to_state_wall_p99_ms)},
      {"budgets.sample_to_state_wall_max_ms", "ms",
       "Allowed wall time from an IMU sample's arrival to its published state, maximum.",
       budget(&B::sample_to_state_wall_max_ms)},
  };
}

std::vector<Setting> estimationSettings() {
  using O = OdometrySettings;
  constexpr auto kOdometry = &Settings::odometry;
  constexpr int kFeatures = static_cast<int>(kMaxFeatures);
  return {
      {"frontend.max_features", "",
       "Maximum number of features tracked at once. A landmark seen by both cameras counts once. More "
       "features improve accuracy and cost CPU time.",
       integer(kOdometry, &O::max_features, 20, kFeatures)},
      {"frontend.use_stereo", "",
       "Use the second camera. If false, only camera 0 is used and the scale comes from the IMU.",
       onOff(kOdometry, &O::use_stereo)},
      {"smoother.horizon", "s",
       "Longest time span of the smoother's window; effort.keyframes limits it too. Older states are "
       "marginalized. full: 30 s, and all keyframes are kept and smoothed together after the run (map.tum): "
       "by `replay` at its end, after a flight by `swiftlet smooth` or flights.smooth.",
       RealOrWordSetting{{member(kOdometry, &O::horizon), 0.5, 60},
                         "full",
                         [](Settings& settings) -> bool& { return settings.full_smoothing; }}},
      {"smoother.full_memory_mib",
       "MiB",
       "Maximum memory for smoothing all keyframes together. A run that needs more is not smoothed.",
       {IntegerSetting{[](Settings& settings) -> int& { return settings.full_memory_mib; }, 64, 1 << 20}}},
      {"smoother.pixel_sigma", "px",
       "Standard deviation of a tracked image coordinate. Larger values give images less weight against the "
       "IMU. The actual noise is estimated in flight, between 0.55 and 15 times this value.",
       real(kOdometry, &O::pixel_sigma, 0.05, 10)},
      {"smoother.estimate_time_offset", "",
       "Estimate in flight the time offset between camera and IMU, and the readout time of a rolling "
       "shutter. Each image waits for samples up to 30 ms after its stamp.",
       onOff(kOdometry, &O::estimate_time_offset)},
      {"smoother.estimate_extrinsics", "", "Estimate in flight the pose of each camera relative to the IMU.",
       onOff(kOdometry, &O::estimate_extrinsics)},
      {"smoother.estimate_gyro", "", "Estimate in flight the scale and misalignment of the gyroscope.",
       onOff(kOdometry, &O::estimate_gyro)},
      {"regularity.enabled", "", "Constrain landmarks to the floors and walls that the mesher finds.",
       onOff(kOdometry, &O::regularity_enabled)},
      {"regularity.point_sigma", "m",
       "Standard deviation of a landmark's distance from its plane. Smaller values flatten floors and walls "
       "harder.",
       real(kOdometry, &O::plane_point_sigma, 1e-4, 0.1)},
      {"health.max_speed", "m/s",
       "Highest speed of the vehicle. The health is not good while the estimated speed is above it. If it "
       "stays above, the odometry restarts with a new epoch.",
       real(kOdometry, &O::max_speed, 0.1, 1000)},
      {"health.max_acceleration", "m/s^2",
       "Highest acceleration of the vehicle, averaged over half a second. The health is not good while the "
       "estimate is above it.",
       real(kOdometry, &O::max_acceleration, 0.1, 10000)},
      {"imu.gyro_inflation", "",
       "Multiplier on the gyroscope noise density in the calibration. Raise it for vibration, scale error "
       "and misalignment; larger values trust the gyroscope less.",
       real(kOdometry, &O::gyro_inflation, 0.1, 100)},
      {"imu.accel_inflation", "",
       "Multiplier on the accelerometer noise density in the calibration. Larger values trust the "
       "accelerometer less.",
       real(kOdometry, &O::accel_inflation, 0.1, 100)},
      {"effort.iterations", "",
       "Maximum number of Gauss-Newton iterations per frame. More iterations cost CPU time.",
       integer(&Settings::effort, &Effort::iterations, 1, 20)},
      {"effort.features", "",
       "Maximum number of features per frame in tracking and in the smoother. frontend.max_features also "
       "limits tracking.",
       integer(&Settings::effort, &Effort::features, 20, kFeatures)},
      {"effort.keyframes", "", "Number of keyframes in the smoother's window. More keyframes cost CPU time.",
       integer(&Settings::effort, &Effort::keyframes, 4, 12)},
      {"pairing.tolerance_ms", "ms",
       "Largest difference between the stamps of a stereo pair. Limited to a quarter of the frame interval.",
       real(&Settings::pairing, &PairingGroup::tolerance_ms, 0, 50)},
      {"pairing.patience_ms", "ms",
       "Longest wait for the other camera's image. After it an image is used without its partner.",
       real(&Settings::pairing, &PairingGroup::patience_ms, 1, 1000)},
      {"flights.folder", "",
       "Folder in which `fly` creates a new folder for each flight if --out is not given.",
       TextSetting{member(&Settings::flights, &FlightsGroup::folder), "a folder name"}},
      {"flights.keep_free_mib", "MiB",
       "Free disk space that `fly` ensures at its start by deleting the oldest flights in flights.folder; 0: "
       "flights are never deleted.",
       integer(&Settings::flights, &FlightsGroup::keep_free_mib, 0, 1 << 30)},
      {"flights.smooth", "",
       "Smooth all keyframes together at the end of `fly` (map.tum); needs smoother.horizon: full. If false, "
       "`swiftlet smooth RUN` does it later.",
       onOff(&Settings::flights, &FlightsGroup::smooth)},
      {"mesh.enabled", "", "Build a mesh of the vehicle's surroundings in flight.",
       onOff(&Settings::mesh, &MeshGroup::enabled)},
      {"loop.enabled", "", "Detect revisited places and correct drift with them: T_map_world, map.tum.",
       onOff(&Settings::loop, &LoopGroup::enabled)},
      {"loop.vocabulary", "",
       "Vocabulary file for place recognition: compact form, ORBvoc.txt or DBoW2 YAML; empty: the built-in "
       "vocabulary.",
       TextSetting{member(&Settings::loop, &LoopGroup::vocabulary), "a file name, or empty"}},
      {"loop.in_map", "",
       "Folder of a kept map, written by `--keep-map`. The flight is localized in this map: T_map_world and "
       "in_map.tum are in its frame. Empty: disabled.",
       TextSetting{member(&Settings::loop, &LoopGroup::in_map), "a folder name, or empty"}},
      {"loop.extend_map", "",
       "Add this flight's keyframes to the map in loop.in_map and optimize the whole map. If false, the "
       "flight is localized and the map does not change.",
       onOff(&Settings::loop, &LoopGroup::extend_map)},
      {"loop.min_similarity", "",
       "Minimum similarity of a loop candidate, relative to the similarity of consecutive keyframes. Larger "
       "values give fewer candidates. After the first selected loop, keyframes close to each other in the "
       "map are candidates regardless of similarity.",
       real(&Settings::loop_stage, &LoopSettings::min_similarity, 0, 10)},
      {"loop.consistency", "",
       "Reject loop closures that contradict the odometry, other loops or the solved graph. If false, every "
       "geometrically verified loop is used (for comparison only).",
       onOff(&Settings::loop_stage, &LoopSettings::consistency)},
      {"map.enabled", "",
       "Fuse depth into a map in flight: labelled surface (map.ply, map.glb) and distance field.",
       onOff(&Settings::map, &MapGroup::enabled)},
      {"map.depth_sensor", "",
       "Use the depth images of the log (depth0) if there are any. If false, depth always comes from the two "
       "cameras.",
       onOff(&Settings::map, &MapGroup::depth_sensor)},
      {"map.voxel_size", "m",
       "Edge length of the map's voxels. Smaller voxels show finer detail and cost memory and CPU time.",
       real(&Settings::map_stage, &MapSettings::voxel_size, 0.01, 0.5)},
      {"map.volume_mib", "MiB",
       "Memory for voxels. When it is full, the voxels farthest from the vehicle move to the run folder.",
       integer(&Settings::map_stage, &MapSettings::volume_mib, 1, 16384)},
      {"map.surface_mib", "MiB",
       "Memory for the triangles shown in flight, including those of voxels that moved to the run folder. "
       "When it is full, the farthest triangles are dropped.",
       integer(&Settings::map_stage, &MapSettings::surface_mib, 1, 16384)},
      {"map.most_range", "m",
       "Maximum measured distance that is fused into the map. Farther measurements give no surface; "
       "the space in front of them is free up to this range.",
       real(&Settings::map_stage, &MapSettings::most_range, 0.5, 100)},
      {"map.labels", "", "Store labels in the map if the log or a network provides label images.",
       onOff(&Settings::map_stage, &MapSettings::labels)},
      {"map.moving_labels", "",
       "Labels of moving objects, which are not mapped: numbers separated by commas, for example \"10,12\"; "
       "empty: none.",
       TextSetting{member(&Settings::map_stage, &MapSettings::moving_labels),
                   "labels separated by commas, or empty"}},
      {"map.label_certainty", "",
       "Probability that a pixel's label is correct. Larger values weigh each observation more.",
       real(&Settings::map_stage, &MapSettings::label_certainty, 0.5, 0.999)},
      {"map.confusion", "",
       "File with the confusion probabilities of the labelling network, one line true,predicted,probability "
       "for "
       "each pair of labels; empty: map.label_certainty applies to all labels.",
       TextSetting{member(&Settings::map, &MapGroup::confusion), "a file name, or empty"}},
      {"calibration.accept_unusual_rig", "",
       "Accept a rig whose geometry suggests that a transform was inverted, and a baseline above 1 m.",
       onOff(&Settings::calibration, &CalibrationGroup::accept_unusual_rig)},
      {"evaluation.max_gap_ms", "ms",
       "Maximum time between two truth poses between which the truth is interpolated. Larger values accept "
       "truth with longer gaps.",
       real(&Settings::evaluation, &EvaluationGroup::max_gap_ms, 0.1, 1000)},
      {"evaluation.rpe_delta_s", "s", "Time interval of the relative pose error.",
       real(&Settings::evaluation, &EvaluationGroup::rpe_delta_s, 0.05, 600)},
  };
}

std::vector<Setting> makeRegistry() {
  std::vector<Setting> all = estimationSettings();
  for (const auto& group : {deviceSettings(), realtimeSettings(), budgetSettings()}) {
    all.insert(all.end(), group.begin(), group.end());
  }
  return all;
}

/// The text in YAML's single quotes: quotes inside are doubled, nothing else is special.
std::string inQuotes(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? "''" : std::string(1, c);
  return out + "'";
}

std::string_view lastPart(std::string_view key) { return key.substr(key.rfind('.') + 1); }

}  // namespace

std::span<const Setting> settingsRegistry() {
  static const std::vector<Setting> kRegistry = makeRegistry();
  return kRegistry;
}

const Setting* findSetting(std::string_view key) {
  const auto registry = settingsRegistry();
  const auto found = std::ranges::find(registry, key, &Setting::key);
  return found == registry.end() ? nullptr : &*found;
}

std::string_view nearestSetting(std::string_view key) {
  std::string_view best;
  // A suggestion that differs in more than half of the characters is not useful.
  std::size_t best_distance = key.size() / 2 + 1;
  for (const Setting& setting : settingsRegistry()) {
    // The right name in the wrong group counts as nearer than any misspelling.
    const std::size_t distance = lastPart(key) == lastPart(setting.key) ? 1 : editDistance(key, setting.key);
    if (distance < best_distance) {
      best = setting.key;
      best_distance = distance;
    }
  }
  return best;
}

std::string valueText(const Setting& setting, const Settings& settings) {
  // The accessors return mutable references; nothing is written here.
  Settings copy = settings;
  if (const auto* real_or_word = std::get_if<RealOrWordSetting>(&setting.kind)) {
    if (real_or_word->chosen(copy)) return std::string(real_or_word->word);
  }
  if (const auto* text = std::get_if<TextSetting>(&setting.kind)) return inQuotes(text->value(copy));
  return std::visit([&](const auto& kind) { return fmt::format("{}", kind.value(copy)); }, setting.kind);
}

std::string rangeText(const Setting& setting) {
  if (std::holds_alternative<SwitchSetting>(setting.kind)) return "true or false";
  const std::string unit = setting.unit.empty() ? "" : " " + std::string(setting.unit);
  if (const auto* whole = std::get_if<IntegerSetting>(&setting.kind)) {
    return fmt::format("whole number, {} to {}{}", whole->low, whole->high, unit);
  }
  if (const auto* number = std::get_if<RealSetting>(&setting.kind)) {
    return fmt::format("{} to {}{}", number->low, number->high, unit);
  }
  if (const auto* text = std::get_if<TextSetting>(&setting.kind)) return std::string(text->what);
  if (const auto* choice = std::get_if<ChoiceSetting>(&setting.kind)) {
    return fmt::format("one of {}", fmt::join(choice->words, ", "));
  }
  const auto& number = std::get<RealOrWordSetting>(setting.kind);
  return fmt::format("{} to {}{}, or {}", number.low, number.high, unit, number.word);
}

}  // namespace swiftlet
