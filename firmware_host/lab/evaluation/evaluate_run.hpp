#pragma once
// Compares the trajectories of a run folder, or of a single file, with the truth.

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

/// Seconds after the first image from which all systems are compared: all have started by then.
inline constexpr double kCommonStart = 3.0;

AccuracyOptions accuracyOptions(const EvaluationGroup& settings, AlignKind align);

/// Truth from a truth file or a log, of the estimator's body and on the IMU's clock. The functions below take
/// truth on the images' clock (onImageClock), like a run's poses.
struct Truth {
  Trajectory poses;
  std::string name;
  std::optional<Stamp> first_image;  ///< if given by a log
  LogWarnings warnings;              ///< about poses that were omitted
};
/// `without_images`: the log is read as one of tracks, which may be without images.
Truth readTruth(const std::string& path, bool without_images = false);

/// Content of "accuracy" in summary.json: odometry.tum over the whole flight and from kCommonStart, with
/// SE(3) and yaw alignment; states.csv with its consistency; map.tum if it exists, alone and compared with
/// odometry.tum at the same stamps; the share of the flight that revisits places.
nlohmann::ordered_json runAccuracyJson(const std::string& folder, const Trajectory& truth,
                                       const std::string& truth_name, Stamp first_image,
                                       const EvaluationGroup& settings);

/// Revisits over the part of the truth that `estimate` (not empty) covers, within the section. Places visited
/// before the section do not count.
Revisits revisitsOf(const Trajectory& estimate, const Trajectory& truth,
                    const AssociationOptions& section = {});

/// A trajectory file of any kind that readTrajectory() accepts; InputError if it has no pose. Omitted rows
/// are reported in `warnings`.
Trajectory readEstimate(const std::string& path, LogWarnings& warnings);
Trajectory readEstimate(const std::string& path);

/// Warns how many rows of `file` were omitted; the other warnings name the first of each kind.
void warnOfRows(const std::string& file, const LogCounters& counters, LogWarnings& warnings);

/// NEES of a run's keyframes. Keyframes without truth and outside the section are omitted.
Consistency consistencyOf(const std::string& states_file, const Trajectory& truth,
                          const AssociationOptions& options);

}  // namespace swiftlet
