#pragma once
// The factors between two consecutive states with motion.
//
// Residual, 15 x 1, order phi, p, v, bg, ba, whitened (unit covariance if the model holds):
//  - imuFactor: preintegrated increments against the states (Forster et al., T-RO 2017, eq. 45), p and v in
//    the axes of body i, and the random walk of the biases.
//  - constantVelocityFactor: for an interval with a gap in the samples; p and v in world axes, with a large
//    sigma.
// Jacobians are 15 x 15, with respect to the error states of i and j. Gravity in world axes is
// (0, 0, -noise.gravity). Cost: about 3 us each; no allocation.

#include <Eigen/Core>

#include "estimator/imu/imu_noise.hpp"
#include "estimator/imu/preintegration.hpp"
#include "estimator/smoother/gyro_intrinsics_state.hpp"
#include "estimator/smoother/state.hpp"

namespace swiftlet {

struct MotionFactor {
  Vector15d residual;
  Eigen::Matrix<double, 15, 15> jacobian_i;
  Eigen::Matrix<double, 15, 15> jacobian_j;
  /// Jacobian of the first nine rows with respect to the gyro's matrix; only if that is estimated.
  Eigen::Matrix<double, 9, kGyroMatrixDim> jacobian_gyro_matrix;
  bool with_gyro = false;
};

/// `intrinsics`: the gyro's; null: those with which `imu` was integrated. False if the covariance is not
/// positive definite (an interval of zero length).
[[nodiscard]] bool imuFactor(const Preintegration& imu, const ImuNoise& noise, const BodyState& x_i,
                             const BodyState& x_j, MotionFactor& factor,
                             const GyroIntrinsicsState* intrinsics = nullptr);

/// `duration`: s between the states. False unless positive.
[[nodiscard]] bool constantVelocityFactor(double duration, const ImuNoise& noise, const BodyState& x_i,
                                          const BodyState& x_j, MotionFactor& factor);

}  // namespace swiftlet
