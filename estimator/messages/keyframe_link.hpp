#pragma once
// Pose of a keyframe relative to the previous one by the odometry: an edge of the pose graph.

#include <Eigen/Core>
#include <cstdint>

#include "estimator/geometry/se3.hpp"

namespace swiftlet {

struct KeyframeLink {
  bool linked = false;  ///< false: first keyframe of its epoch, or the previous one has left the window
  std::uint64_t previous = 0;  ///< frame index of the previous keyframe
  SE3 T_previous_this;         ///< body to body
  /// Covariance of xi (rotation, translation; rad, m) in T_previous_this <- T_previous_this Exp(xi), in this
  /// keyframe's axes; from the joint marginal of the window.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

}  // namespace swiftlet
