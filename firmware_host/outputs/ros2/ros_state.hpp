#pragma once
// The estimate in the conventions of ROS messages (REP 103, REP 105), independent of the transport.
//
// Frames: `map` and `odom` of REP 105 are swiftlet's map and world; `base_link` is the body, which is the
// IMU. A vehicle with another base_link renames it (RosFrames) and adds its own transform.
// geometry_msgs/PoseWithCovariance: order x y z and rotations about the fixed axes of the header's frame;
// swiftlet's is phi, p with phi about the body's axes (R <- R Exp(phi)). geometry_msgs/TwistWithCovariance of
// nav_msgs/Odometry is in the child frame, so the velocity is rotated to body axes. Angular velocity is not
// part of the state: for a state without a sample it is zero with kUnknownVariance; for a state at an IMU
// sample it is the sample's, without bias.

#include <Eigen/Core>
#include <string>

#include "estimator/messages/nav_state.hpp"

namespace swiftlet {

struct RosFrames {
  std::string map = "map";
  std::string odom = "odom";
  std::string body = "base_link";
  std::string truth = "truth";  ///< axes in which the truth was recorded
};

inline constexpr double kUnknownVariance = 1e6;

using RosCovariance = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

/// Covariance of x y z [m^2] and of the rotation about the world's axes [rad^2].
RosCovariance rosPoseCovariance(const NavState& state);

/// Covariance of the linear velocity [m^2/s^2] and the angular one, both in body axes. First order, including
/// the attitude's part; covariances that `state` does not hold count as zero.
RosCovariance rosTwistCovariance(const NavState& state);
/// The same with the angular velocity of a gyroscope sample: `gyro_sigma` [rad/s], and the state's bias
/// subtracted.
RosCovariance rosTwistCovariance(const NavState& state, double gyro_sigma);

/// m/s, body axes.
Eigen::Vector3d bodyVelocity(const NavState& state);

}  // namespace swiftlet
