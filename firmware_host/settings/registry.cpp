#include "firmware_host/settings/registry.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <vector>

#include "estimator/core/limits.hpp"
#include "firmware_host/settings/setting_makers.hpp"

namespace swiftlet {
namespace {

/// SCHED_FIFO ends at 99, which the kernel's own threads have.
constexpr int kHighestPriority = 98;
/// glibc's fixed CPU sets end there.
constexpr int kHighestCpu = 1023;
/// A budget in milliseconds: longer than this is no flight estimator.
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
       "Ask for the priorities and CPUs below; where the right is missing the run goes on without, and says "
       "so.",
       onOff(&Settings::realtime, &R::enabled)},
      {"realtime.lock_memory", "", "Lock all memory (mlockall) before arming.",
       onOff(&Settings::realtime, &R::lock_memory)},
      {"realtime.sensor_priority", "",
       "SCHED_FIFO priority of the threads that read devices; 0: SCHED_OTHER. Kernels with PREEMPT_RT run "
       "interrupt handlers at 50: stay below. Descending from here to low_priority.",
       priority(&R::sensor_priority)},
      {"realtime.propagate_priority", "", "Likewise, the thread that propagates every IMU sample.",
       priority(&R::propagate_priority)},
      {"realtime.track_priority", "", "Likewise, pairing and the front-end.", priority(&R::track_priority)},
      {"realtime.smooth_priority", "", "Likewise, the smoother.", priority(&R::smooth_priority)},
      {"realtime.mesh_priority", "", "Likewise, the mesh of the near surroundings.",
       priority(&R::mesh_priority)},
      {"realtime.low_priority", "", "Likewise, map, loop closure, recorder and reports.",
       priority(&R::low_priority)},
      {"realtime.sensor_cpu", "", "The one CPU that these threads run on; -1: any.", cpu(&R::sensor_cpu)},
      {"realtime.propagate_cpu", "", "Likewise for the propagation.", cpu(&R::propagate_cpu)},
      {"realtime.track_cpu", "", "Likewise for the front-end.", cpu(&R::track_cpu)},
      {"realtime.smooth_cpu", "", "Likewise for the smoother.", cpu(&R::smooth_cpu)},
      {"realtime.mesh_cpu", "", "Likewise for the mesh.", cpu(&R::mesh_cpu)},
      {"realtime.low_cpu", "", "Likewise for map, loop closure, recorder and reports.", cpu(&R::low_cpu)},
  };
}

RealSetting budget(double BudgetsGroup::*value) {
  return real(&Settings::budgets, value, kShortestBudget, kLongestBudget);
}

std::vector<Setting> budgetSettings() {
  using B = BudgetsGroup;
  constexpr double kWidestSpread = 100;
  return {
      {"budgets.propagate_p50_ms", "ms", "CPU time of a step of the propagation: median.",
       budget(&B::propagate_p50_ms)},
      {"budgets.propagate_p99_ms", "ms", "Likewise, 99 of 100 steps.", budget(&B::propagate_p99_ms)},
      {"budgets.propagate_max_ms", "ms", "Likewise, every step.", budget(&B::propagate_max_ms)},
      {"budgets.track_p50_ms", "ms", "CPU time of a step of the front-end, keyframes included: median.",
       budget(&B::track_p50_ms)},
      {"budgets.track_p99_ms", "ms", "Likewise, 99 of 100 steps.", budget(&B::track_p99_ms)},
      {"budgets.track_max_ms", "ms", "Likewise, every step.", budget(&B::track_max_ms)},
      {"budgets.smooth_p50_ms", "ms", "CPU time of a step of the smoother: median.",
       budget(&B::smooth_p50_ms)},
      {"budgets.smooth_p99_ms", "ms", "Likewise, 99 of 100 steps.", budget(&B::smooth_p99_ms)},
      {"budgets.smooth_max_ms", "ms", "Likewise, every step.", budget(&B::smooth_max_ms)},
      {"budgets.mesh_p50_ms", "ms", "CPU time of a step of the mesher, keyframes included: median.",
       budget(&B::mesh_p50_ms)},
      {"budgets.mesh_p99_ms", "ms", "Likewise, 99 of 100 steps.", budget(&B::mesh_p99_ms)},
      {"budgets.mesh_max_ms", "ms", "Likewise, every step.", budget(&B::mesh_max_ms)},
      {"budgets.image_to_pose_p50_ms", "ms",
       "CPU time from a frame's images to its pose, all stages: median.", budget(&B::image_to_pose_p50_ms)},
      {"budgets.image_to_pose_p99_ms", "ms", "Likewise, 99 of 100 frames.", budget(&B::image_to_pose_p99_ms)},
      {"budgets.image_to_pose_max_ms", "ms", "Likewise, every frame.", budget(&B::image_to_pose_max_ms)},
      {"budgets.image_to_pose_spread", "",
       "Largest p99/p50 of that CPU time, of keyframes and of the other frames each by itself.",
       real(&Settings::budgets, &B::image_to_pose_spread, 1, kWidestSpread)},
      {"budgets.image_to_pose_wall_p99_ms", "ms",
       "Wall time from the arrival of a frame's last image to its published pose, 99 of 100 frames. The "
       "machine's own lateness is in it: the bare timer loop beside it says how much.",
       budget(&B::image_to_pose_wall_p99_ms)},
      {"budgets.image_to_pose_wall_max_ms", "ms", "Likewise, every frame.",
       budget(&B::image_to_pose_wall_max_ms)},
      {"budgets.sample_to_state_p50_ms", "ms", "CPU time from an IMU sample to its published state: median.",
       budget(&B::sample_to_state_p50_ms)},
      {"budgets.sample_to_state_p99_ms", "ms", "Likewise, 99 of 100 samples.",
       budget(&B::sample_to_state_p99_ms)},
      {"budgets.sample_to_state_wall_p99_ms", "ms",
       "Wall time from a sample's arrival to its published state, 99 of 100 samples.",
       budget(&B::sample_to_state_wall_p99_ms)},
      {"budgets.sample_to_state_wall_max_ms", "ms", "Likewise, every sample.",
       budget(&B::sample_to_state_wall_max_ms)},
  };
}

std::vector<Setting> estimationSettings() {
  using O = OdometrySettings;
  constexpr auto kOdometry = &Settings::odometry;
  constexpr int kFeatures = static_cast<int>(kMaxFeatures);
  return {
      {"frontend.max_features", "", "Features tracked at once; a landmark seen by both cameras counts once.",
       integer(kOdometry, &O::max_features, 20, kFeatures)},
      {"frontend.use_stereo", "", "Use the second camera; false: camera 0 alone, scale from the IMU.",
       onOff(kOdometry, &O::use_stereo)},
      {"smoother.horizon", "s",
       "Fixed lag: no state older than this stays in the window. full: the default lag in flight, and all "
       "keyframes of the run are kept to be smoothed together (map.tum): by `replay` at its end, of a flight "
       "by `swiftlet smooth` (flights.smooth).",
       RealOrWordSetting{{member(kOdometry, &O::horizon), 0.5, 60},
                         "full",
                         [](Settings& settings) -> bool& { return settings.full_smoothing; }}},
      {"smoother.full_memory_mib",
       "MiB",
       "Memory that smoothing all keyframes together may take. A run that needs more is not smoothed.",
       {IntegerSetting{[](Settings& settings) -> int& { return settings.full_memory_mib; }, 64, 1 << 20}}},
      {"smoother.pixel_sigma", "px",
       "Usual noise of one tracked coordinate, 1 sigma; found in flight from 0.55 to 15 times of it.",
       real(kOdometry, &O::pixel_sigma, 0.05, 10)},
      {"smoother.estimate_time_offset", "",
       "Estimate the offset between camera and IMU clocks in flight, and the readout of a rolling shutter.",
       onOff(kOdometry, &O::estimate_time_offset)},
      {"smoother.estimate_extrinsics", "", "Estimate how the cameras sit on the IMU in flight.",
       onOff(kOdometry, &O::estimate_extrinsics)},
      {"smoother.estimate_gyro", "", "Estimate scale and misalignment of the gyro in flight.",
       onOff(kOdometry, &O::estimate_gyro)},
      {"regularity.enabled", "", "Tie landmarks to the floors and walls that the mesher finds.",
       onOff(kOdometry, &O::regularity_enabled)},
      {"regularity.point_sigma", "m", "By which a point of a wall is off its plane, 1 sigma.",
       real(kOdometry, &O::plane_point_sigma, 1e-4, 0.1)},
      {"health.max_speed", "m/s", "What the vehicle can do; an estimate beyond it is not good.",
       real(kOdometry, &O::max_speed, 0.1, 1000)},
      {"health.max_acceleration", "m/s^2", "The same, over half a second.",
       real(kOdometry, &O::max_acceleration, 0.1, 10000)},
      {"imu.gyro_inflation", "",
       "Factor on the calibration's gyro noise density, for vibration, scale and misalignment in flight.",
       real(kOdometry, &O::gyro_inflation, 0.1, 100)},
      {"imu.accel_inflation", "", "Likewise for the accelerometer.",
       real(kOdometry, &O::accel_inflation, 0.1, 100)},
      {"effort.iterations", "", "Gauss-Newton iterations a frame may spend.",
       integer(&Settings::effort, &Effort::iterations, 1, 20)},
      {"effort.features", "",
       "Features a frame may spend, in tracking and in the smoother; frontend.max_features counts too.",
       integer(&Settings::effort, &Effort::features, 20, kFeatures)},
      {"effort.keyframes", "", "Keyframes that the smoother's window keeps.",
       integer(&Settings::effort, &Effort::keyframes, 4, 12)},
      {"pairing.tolerance_ms", "ms",
       "Largest difference of stamps within a stereo pair; never more than a quarter of the frame interval.",
       real(&Settings::pairing, &PairingGroup::tolerance_ms, 0, 50)},
      {"pairing.patience_ms", "ms", "Longest wait for the other camera's frame before one goes on alone.",
       real(&Settings::pairing, &PairingGroup::patience_ms, 1, 1000)},
      {"flights.folder", "",
       "Folder in which `fly` makes a new folder for each flight, where it is not given --out.",
       TextSetting{member(&Settings::flights, &FlightsGroup::folder), "a folder's name"}},
      {"flights.keep_free_mib", "MiB",
       "Free space that `fly` makes at its start by deleting the oldest flights in flights.folder; 0: "
       "flights are never deleted.",
       integer(&Settings::flights, &FlightsGroup::keep_free_mib, 0, 1 << 30)},
      {"flights.smooth", "",
       "Smooth all keyframes together at the end of `fly` (map.tum), with smoother.horizon: full. false: "
       "`swiftlet smooth RUN` does it later.",
       onOff(&Settings::flights, &FlightsGroup::smooth)},
      {"mesh.enabled", "", "Mesh the near surroundings in flight.",
       onOff(&Settings::mesh, &MeshGroup::enabled)},
      {"loop.enabled", "",
       "Recognize places seen before and keep a map that they hold together: T_map_world, map.tum.",
       onOff(&Settings::loop, &LoopGroup::enabled)},
      {"loop.vocabulary", "",
       "File of the words that places are known by: compact, ORBvoc.txt or DBoW2's; empty: the one that is "
       "part of the program.",
       TextSetting{member(&Settings::loop, &LoopGroup::vocabulary), "a file's name, or empty"}},
      {"loop.in_map", "",
       "Folder of a kept map, written by `--keep-map`. The flight is localized in this map: T_map_world and "
       "in_map.tum are in its frame. Empty: disabled.",
       TextSetting{member(&Settings::loop, &LoopGroup::in_map), "a folder's name, or empty"}},
      {"loop.extend_map", "",
       "Add this flight's keyframes to the map of loop.in_map and optimize all of it. false: localization "
       "only, the map does not change.",
       onOff(&Settings::loop, &LoopGroup::extend_map)},
      {"loop.min_similarity", "",
       "Least similarity of a place looked at as a revisit, relative to that of a keyframe with the one "
       "before it; once a loop is believed, keyframes near each other in the map need none.",
       real(&Settings::loop_stage, &LoopSettings::min_similarity, 0, 10)},
      {"loop.consistency", "",
       "Reject loop closures that contradict the odometry, other loops or the solved graph. false: every "
       "geometrically verified loop is used, for comparison only.",
       onOff(&Settings::loop_stage, &LoopSettings::consistency)},
      {"map.enabled", "",
       "Fuse depth into a map in flight: labelled surface (map.ply, map.glb) and distance field.",
       onOff(&Settings::map, &MapGroup::enabled)},
      {"map.depth_sensor", "",
       "Take depth from a sensor where the log has one (depth0); false: always from the two cameras.",
       onOff(&Settings::map, &MapGroup::depth_sensor)},
      {"map.voxel_size", "m", "Edge of the map's voxels.",
       real(&Settings::map_stage, &MapSettings::voxel_size, 0.01, 0.5)},
      {"map.volume_mib", "MiB",
       "Memory for voxels; when it is full the farthest from the vehicle go to the run folder.",
       integer(&Settings::map_stage, &MapSettings::volume_mib, 1, 16384)},
      {"map.surface_mib", "MiB",
       "Memory for the triangles that are shown in flight, those of dropped voxels too.",
       integer(&Settings::map_stage, &MapSettings::surface_mib, 1, 16384)},
      {"map.most_range", "m", "What is measured farther away gives no surface.",
       real(&Settings::map_stage, &MapSettings::most_range, 0.5, 100)},
      {"map.labels", "", "Keep labels where the log, or a network, gives label images.",
       onOff(&Settings::map_stage, &MapSettings::labels)},
      {"map.moving_labels", "",
       "Labels of things that move, which are not mapped: numbers with commas, as \"10,12\"; empty: none.",
       TextSetting{member(&Settings::map_stage, &MapSettings::moving_labels),
                   "labels with commas, or empty"}},
      {"map.label_certainty", "", "Probability that a pixel's label is right.",
       real(&Settings::map_stage, &MapSettings::label_certainty, 0.5, 0.999)},
      {"map.confusion", "",
       "File of how often the network that labels images takes one label for another, lines of "
       "true,said,probability; empty: map.label_certainty for all.",
       TextSetting{member(&Settings::map, &MapGroup::confusion), "a file's name, or empty"}},
      {"calibration.accept_unusual_rig", "",
       "Take a rig whose geometry looks like a transform read the wrong way round.",
       onOff(&Settings::calibration, &CalibrationGroup::accept_unusual_rig)},
      {"evaluation.max_gap_ms", "ms", "Truth is interpolated between poses at most this far apart.",
       real(&Settings::evaluation, &EvaluationGroup::max_gap_ms, 0.1, 1000)},
      {"evaluation.rpe_delta_s", "s", "Interval of the relative pose error over time.",
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

/// Levenshtein distance.
std::size_t editDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

/// In YAML's single quotes, within which a quote is doubled and nothing else is special.
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
  // Beyond half the name wrong, a suggestion is noise.
  std::size_t best_distance = key.size() / 2 + 1;
  for (const Setting& setting : settingsRegistry()) {
    // The right name in the wrong group is nearer than any misspelling.
    const std::size_t distance = lastPart(key) == lastPart(setting.key) ? 1 : editDistance(key, setting.key);
    if (distance < best_distance) {
      best = setting.key;
      best_distance = distance;
    }
  }
  return best;
}

std::string valueText(const Setting& setting, const Settings& settings) {
  // The accessors give references that may be written through; nothing is written here.
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
