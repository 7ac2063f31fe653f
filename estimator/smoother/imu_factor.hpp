#pragma once
// The factors between two consecutive states with motion.
//
// Residual order: phi, p, v, bg, ba, whitened (unit covariance when the model holds).
//  - imuFactor: preintegrated increments against the states (Forster et al., T-RO 2017, eq. 45)
//    and the random walk of the biases.
//  - constantVelocityFactor: for an interval with a gap in the samples.
// Jacobians are taken at `linearization` states, the residual at the current ones.
// Cost: about 3 us each.

#include <Eigen/Core>

#include "estimator/imu/imu_noise.hpp"
#include "estimator/imu/preintegration.hpp"
#include "estimator/smoother/state.hpp"

namespace swiftlet {

struct MotionFactor {
  Vector15d residual;
  Eigen::Matrix<double, 15, 15> jacobian_i;
  Eigen::Matrix<double, 15, 15> jacobian_j;
};

/// False when the covariance is not positive definite (an interval without duration).
[[nodiscard]] bool imuFactor(const Preintegration& imu, const ImuNoise& noise, const BodyState& x_i,
                             const BodyState& x_j, const BodyState& linearization_i,
                             const BodyState& linearization_j, MotionFactor& factor);

[[nodiscard]] bool constantVelocityFactor(double duration, const ImuNoise& noise, const BodyState& x_i,
                                          const BodyState& x_j, const BodyState& linearization_i,
                                          const BodyState& linearization_j, MotionFactor& factor);

}  // namespace swiftlet
