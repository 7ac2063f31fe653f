#pragma once
// Standard deviations of a state, one figure per quantity.

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "estimator/messages/nav_state.hpp"

namespace swiftlet {

/// m/s, largest over the axes.
inline double velocitySigma(const NavState& state) {
  return std::sqrt(state.covariance.diagonal().segment<3>(6).maxCoeff());
}

/// rad, mean of the two horizontal axes; heading is not observable and not included.
inline double tiltSigma(const NavState& state) {
  const Eigen::Vector3d up = state.T_world_body.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  const Eigen::Matrix3d P = state.covariance.topLeftCorner<3, 3>();
  return std::sqrt(std::max(0.0, P.trace() - up.dot(P * up)) / 2);
}

}  // namespace swiftlet
