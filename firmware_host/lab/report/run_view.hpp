#pragma once
// A run beside its truth, in the axes of the run's own world: what all plots are made from.

#include <optional>
#include <vector>

#include "firmware_host/lab/evaluation/accuracy.hpp"
#include "firmware_host/lab/evaluation/consistency.hpp"
#include "firmware_host/lab/report/run_files.hpp"

namespace swiftlet {

/// Where a trajectory of the run lies off the truth.
struct PoseErrors {
  std::vector<double> t;         ///< s since the first image
  std::vector<double> distance;  ///< m, after the run's one alignment
  std::vector<double> degrees;   ///< of the attitude, after the best fit of the rotations about gravity
};

struct RunView {
  RunFiles files;
  std::string truth_name;  ///< empty: no truth
  Trajectory truth;        ///< in the run's world, of the flight's time only
  Duration max_gap;        ///< between poses of the truth that are interpolated
  Alignment fit;           ///< from the run's world to the truth's, yaw and translation
  Accuracy odometry;       ///< yaw alignment
  PoseErrors odometry_errors;
  PoseErrors map_errors;
  /// Of the keyframes with truth, in the gauge of the first of them; `error_stamps` beside them.
  std::vector<ConsistencyError> keyframe_errors;
  std::vector<Stamp> error_stamps;

  [[nodiscard]] bool hasTruth() const { return !truth.empty(); }
};

/// Empty `truth`: there is none. `options`: how far apart poses of the truth may be.
RunView viewOf(RunFiles files, const Trajectory& truth, const std::string& truth_name,
               const AccuracyOptions& options);

}  // namespace swiftlet
