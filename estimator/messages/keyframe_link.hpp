#pragma once
// How a keyframe stands to the one before it, as the odometry knows it: an edge of the pose graph.

#include <Eigen/Core>
#include <cstdint>

#include "estimator/geometry/se3.hpp"

namespace swiftlet {

struct KeyframeLink {
  bool linked = false;         ///< false: the first of its epoch, or the one before has left the window
  std::uint64_t previous = 0;  ///< frame index of the keyframe before
  SE3 T_previous_this;         ///< body to body
  /// Of xi (rotation, translation; rad, m) in T_previous_this <- T_previous_this Exp(xi), that is in this
  /// keyframe's own axes; from the window's joint marginal.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

}  // namespace swiftlet
