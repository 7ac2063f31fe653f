#pragma once
// The estimate as passed to all consumers.

#include <Eigen/Core>
#include <cstdint>

#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

enum class Health : std::uint8_t {
  kInitializing,  ///< no pose yet, or tilt and velocity are not settled
  kGood,
  kDegraded,  ///< usable, with less than the usual input: one camera, few tracks, coasting
  kFailed,    ///< must not be used for flight
};

/// Error-state order everywhere: phi, p, v, bg, ba (rotation on the right: R <- R Exp(phi)).
inline constexpr int kStateDim = 15;
using Matrix15d = Eigen::Matrix<double, kStateDim, kStateDim>;

struct NavState {
  Stamp stamp;
  std::uint32_t epoch = 0;  ///< incremented by every re-initialization
  Health health = Health::kInitializing;
  SE3 T_world_body;
  Eigen::Vector3d v_world_body = Eigen::Vector3d::Zero();  ///< m/s, world axes
  Eigen::Vector3d bias_gyro = Eigen::Vector3d::Zero();     ///< rad/s
  Eigen::Vector3d bias_accel = Eigen::Vector3d::Zero();    ///< m/s^2
  Matrix15d covariance = Matrix15d::Zero();
};

}  // namespace swiftlet
