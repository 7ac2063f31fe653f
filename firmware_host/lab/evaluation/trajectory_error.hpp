#pragma once
// Absolute trajectory error (ATE): distance of the aligned estimate from the truth.
//
// The estimate is moved onto the truth by the transform that minimizes the sum of squared distances over the
// given pairs only, then
//   translation error_i = |p_truth_i - A p_estimate_i|                        [m]
//   rotation error_i    = angle of R_truth_i^T R_A R_estimate_i               [deg]
//   attitude error_i    = the same with the R that fits the rotations themselves best (about gravity
//                         only for yaw alignment)                             [deg]
//   tilt error_i        = angle between the verticals (z of their worlds) of both poses, without alignment:
//                         meaningful if the truth's z is along gravity        [deg]
// R_A comes from positions: over a short path it is inaccurate, at rest it is arbitrary, and so is the
// rotation error; the attitude error is not affected. The translation RMSE is what evo_ape prints with -a
// (SE(3)) or -as (Sim(3)). Yaw alignment keeps the direction of gravity, which a visual-inertial estimate
// observes. Sources: Sturm et al., IROS 2012; Umeyama, PAMI 1991; Zhang, Scaramuzza, IROS 2018.

#include <cstddef>
#include <span>
#include <string_view>

#include "estimator/core/status.hpp"
#include "estimator/geometry/alignment.hpp"
#include "firmware_host/lab/evaluation/association.hpp"
#include "firmware_host/lab/evaluation/error_statistics.hpp"

namespace swiftlet {

enum class AlignKind { kSe3, kSim3, kYaw };

/// "se3", "sim3", "yaw".
std::string_view alignName(AlignKind kind);

struct TrajectoryError {
  AlignKind kind = AlignKind::kSe3;
  Alignment alignment;          ///< estimate to truth
  Status status;                ///< kDegenerate: a constant pose or a straight line; figures are still given
  ErrorStatistics translation;  ///< m
  ErrorStatistics rotation;     ///< degrees, under the alignment of the positions
  ErrorStatistics attitude;     ///< degrees, under the best fit of the rotations
  ErrorStatistics tilt;         ///< degrees, without any alignment
  Eigen::Vector3d axis_rmse = Eigen::Vector3d::Zero();  ///< m, along the truth's axes
  double path_length = 0;                               ///< m, of the truth over the pairs
};

/// Fewer pairs can always be aligned almost without error, so there are no figures for them.
constexpr std::size_t kFewestPairs = 3;

/// kInvalidInput (in `status`) without pairs; only the alignment with fewer than kFewestPairs.
TrajectoryError trajectoryError(std::span<const PosePair> pairs, AlignKind kind);

}  // namespace swiftlet
