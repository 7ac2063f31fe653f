#include "firmware_host/outputs/ros2/ros_state.hpp"

#include "estimator/geometry/so3.hpp"

namespace swiftlet {

RosCovariance rosPoseCovariance(const NavState& state) {
  // (dp, dtheta) = J (phi, dp), dtheta = R phi.
  Eigen::Matrix<double, 6, 6> J = Eigen::Matrix<double, 6, 6>::Zero();
  J.topRightCorner<3, 3>().setIdentity();
  J.bottomLeftCorner<3, 3>() = state.T_world_body.R();
  return J * state.covariance.topLeftCorner<6, 6>() * J.transpose();
}

Eigen::Vector3d bodyVelocity(const NavState& state) {
  return state.T_world_body.rotation.conjugate() * state.v_world_body;
}

RosCovariance rosTwistCovariance(const NavState& state) {
  // v_body = R^T v: its error is R^T dv + [v_body]x phi.
  const Eigen::Matrix3d R_body_world = state.T_world_body.R().transpose();
  Eigen::Matrix<double, 3, 9> J = Eigen::Matrix<double, 3, 9>::Zero();
  J.leftCols<3>() = hat(bodyVelocity(state));
  J.rightCols<3>() = R_body_world;
  RosCovariance covariance = RosCovariance::Zero();
  covariance.topLeftCorner<3, 3>() = J * state.covariance.topLeftCorner<9, 9>() * J.transpose();
  covariance.diagonal().tail<3>().setConstant(kUnknownVariance);
  return covariance;
}

RosCovariance rosTwistCovariance(const NavState& state, double gyro_sigma) {
  constexpr int kGyroBias = 9;
  RosCovariance covariance = rosTwistCovariance(state);
  covariance.bottomRightCorner<3, 3>() = state.covariance.block<3, 3>(kGyroBias, kGyroBias) +
                                         gyro_sigma * gyro_sigma * Eigen::Matrix3d::Identity();
  return covariance;
}

}  // namespace swiftlet
