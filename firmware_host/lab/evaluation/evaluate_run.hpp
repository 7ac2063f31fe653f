#pragma once
// The trajectories of a run folder, or of a single file, against the truth.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "drivers/recorded/trajectory_file.hpp"
#include "firmware_host/lab/evaluation/accuracy.hpp"
#include "firmware_host/lab/evaluation/common_stamps.hpp"
#include "firmware_host/lab/evaluation/consistency.hpp"
#include "firmware_host/lab/evaluation/loop_accuracy.hpp"
#include "firmware_host/lab/evaluation/revisits.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// Seconds after the first image from which every system is compared: all have started by then.
inline constexpr double kCommonStart = 3.0;

AccuracyOptions accuracyOptions(const EvaluationGroup& settings, AlignKind align);

/// A truth file's or a log's truth, in the estimator's body, on the IMU's clock. Everything below takes a
/// truth on the images' clock (onImageClock), as a run's poses are.
struct Truth {
  Trajectory poses;
  std::string name;
  std::optional<Stamp> first_image;  ///< where a log says
  LogWarnings warnings;              ///< what was left out of the poses
};
/// `without_images`: a log is read as one of tracks, which need not hold images.
Truth readTruth(const std::string& path, bool without_images = false);

/// Content of "accuracy" in summary.json: odometry.tum over all and from kCommonStart, SE(3) and yaw
/// alignment; states.csv with its consistency; map.tum if it exists, alone and compared with odometry.tum at
/// the same stamps; the share of the flight that revisits places.
nlohmann::ordered_json runAccuracyJson(const std::string& folder, const Trajectory& truth,
                                       const std::string& truth_name, Stamp first_image,
                                       const EvaluationGroup& settings);

/// Of a loops.csv.
LoopAccuracy loopsOf(const std::string& loops_file, const Trajectory& truth, const EvaluationGroup& settings);

/// Over the part of the truth that `estimate` (not empty) covers.
Revisits revisitsOf(const Trajectory& estimate, const Trajectory& truth);

/// A trajectory file of any kind readTrajectory() takes; InputError when it has no pose. `warnings` receives
/// what was left out.
Trajectory readEstimate(const std::string& path, LogWarnings& warnings);
Trajectory readEstimate(const std::string& path);

/// How many rows were left out of `file`; the other warnings name the first of each kind.
void warnOfRows(const std::string& file, const LogCounters& counters, LogWarnings& warnings);

/// NEES of a run's keyframes. Keyframes without truth are left out.
Consistency consistencyOf(const std::string& states_file, const Trajectory& truth, Duration max_gap);

}  // namespace swiftlet
