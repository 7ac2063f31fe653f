#pragma once
// NEES: whether the covariance matches the size of the error.
//
// Error state as everywhere: phi (body axes, R_truth = R_estimate Exp(phi)) and p (world axes). Position and
// yaw are not observable, so both trajectories are taken relative to their first pair: the estimate is moved
// by the yaw and translation that make the first poses agree. For a consistent estimate the mean of e^T P^-1
// e is the number of degrees of freedom: 6 for the pose, 3 for each half. Source: Bar-Shalom, Li,
// Kirubarajan, "Estimation with Applications to Tracking and Navigation", 5.4.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "estimator/geometry/se3.hpp"

namespace swiftlet {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

struct ConsistencySample {
  SE3 estimate;
  SE3 truth;
  Matrix6d covariance = Matrix6d::Zero();  ///< of (phi, p)
};

/// Error of one sample in the common gauge, with the covariance transformed to that gauge.
struct ConsistencyError {
  Eigen::Matrix<double, 6, 1> error = Eigen::Matrix<double, 6, 1>::Zero();  ///< (phi, p): rad, m
  Matrix6d covariance = Matrix6d::Zero();
};

/// One error per sample; the first one fixes the gauge, so its yaw and position are zero.
std::vector<ConsistencyError> consistencyErrors(std::span<const ConsistencySample> samples);

struct Consistency {
  std::size_t count = 0;
  std::size_t without_covariance = 0;  ///< omitted: singular or not finite
  double nees_pose = 0;                ///< mean; 6 = consistent
  double nees_rotation = 0;            ///< mean; 3
  double nees_position = 0;            ///< mean; 3
  double inside_3_sigma = 0;           ///< share of (sample, axis) with |e| <= 3 sigma
};

/// The first sample only fixes the gauge and is not counted.
Consistency consistency(std::span<const ConsistencySample> samples);

}  // namespace swiftlet
