#pragma once
// A run and its truth, in the axes of the run's own world: the input of all plots.

#include <optional>
#include <vector>

#include "firmware_host/lab/evaluation/accuracy.hpp"
#include "firmware_host/lab/evaluation/consistency.hpp"
#include "firmware_host/lab/report/run_files.hpp"

namespace swiftlet {

/// Errors of one of the run's trajectories.
struct PoseErrors {
  std::vector<double> t;         ///< s since the first image
  std::vector<double> distance;  ///< m, after the run's one alignment
  std::vector<double> degrees;   ///< of the attitude, after the best alignment of the rotations about gravity
};

struct RunView {
  RunFiles files;
  std::string truth_name;  ///< empty: no truth
  Trajectory truth;        ///< in the run's world, only during the flight
  Duration max_gap;        ///< longest gap between truth poses that is interpolated
  Alignment fit;           ///< from the run's world to the truth's, yaw and translation
  Accuracy odometry;       ///< yaw alignment
  PoseErrors odometry_errors;
  PoseErrors map_errors;
  /// Of the keyframes with truth, in the gauge of the first of them; their stamps are in `error_stamps`.
  std::vector<ConsistencyError> keyframe_errors;
  std::vector<Stamp> error_stamps;

  [[nodiscard]] bool hasTruth() const { return !truth.empty(); }
};

/// Empty `truth`: there is none. `options`: longest gap between poses of the truth.
RunView viewOf(RunFiles files, const Trajectory& truth, const std::string& truth_name,
               const AccuracyOptions& options);

}  // namespace swiftlet
