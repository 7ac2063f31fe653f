#pragma once
// Converts the estimator's state to what autopilots expect: the vehicle's reference point instead of the IMU,
// and forward-right-down axes instead of z up.
//
// Frames: `body` is the IMU as calibrated, `vehicle` its mounting: forward, left, up. The local frame that is
// sent is the world rotated to x, -y, -z: FRD with a heading not referenced to north. Velocity and rates are
// in the vehicle's FRD axes.
//   p = p_W_B + R_W_B r            v = R_W_V^T (v_W_B + R_W_B (omega x r))        r: IMU to reference point
//   M = diag(1, -1, -1) on both sides of every block
// Covariances are first order; angles are the error phi rotated to the world's axes (docs/mavlink.md). Pure;
// no memory; about 2 us.

#include <Eigen/Geometry>

#include "drivers/mavlink/vision_messages.hpp"
#include "estimator/messages/nav_state.hpp"

namespace swiftlet {

struct AutopilotMounting {
  Eigen::Quaterniond q_vehicle_body = Eigen::Quaterniond::Identity();  ///< vehicle: forward, left, up
  Eigen::Vector3d p_body_vehicle = Eigen::Vector3d::Zero();            ///< [m] r
};

/// `omega_body`: angular rate without bias [rad/s]. Stamp: the state's, in whole microseconds.
mavlink::Odometry odometryOf(const NavState& state, const Eigen::Vector3d& omega_body,
                             const AutopilotMounting& mounting);
/// The same for autopilots without ODOMETRY; angles are roll, pitch and yaw in FRD.
mavlink::VisionPositionEstimate positionEstimateOf(const NavState& state, const AutopilotMounting& mounting);

/// Quality for the autopilot's threshold: 1 to 100; 0 before the first state, -1 if the estimator failed.
std::int8_t qualityOf(Health health);

}  // namespace swiftlet
