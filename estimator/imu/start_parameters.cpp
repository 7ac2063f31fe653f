#include "estimator/imu/start_parameters.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {

Eigen::Matrix<double, 3, 2> StartParameters::basis() const {
  const Eigen::Vector3d other = std::abs(up_.x()) < 0.7 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  Eigen::Matrix<double, 3, 2> B;
  B.col(0) = up_.cross(other).normalized();
  B.col(1) = up_.cross(B.col(0));
  return B;
}

StartPose StartParameters::poseAt(const Preintegration& imu, double gravity) const {
  const double t = imu.duration();
  StartPose pose;
  pose.rotation = imu.deltaRotation(bias_gyro_);
  pose.position = velocity_ * t - (0.5 * gravity * t * t) * up_ + imu.deltaPosition(bias_gyro_, bias_accel_);
  pose.d_position.middleCols<3>(kVelocity) = t * Eigen::Matrix3d::Identity();
  // up_true = Exp(-phi) up = up + hat(up) phi
  pose.d_position.middleCols<2>(kTilt) = (-0.5 * gravity * t * t) * hat(up_) * basis();
  pose.d_position.middleCols<3>(kBiasGyro) = imu.jacobianGyro().middleRows<3>(3);
  pose.d_position.middleCols<3>(kBiasAccel) = imu.jacobianAccel().middleRows<3>(3);
  pose.d_rotation = imu.jacobianGyro().topRows<3>();
  return pose;
}

void StartParameters::addPrior(const TiltEstimate& tilt, const StartPrior& prior,
                               Eigen::Ref<Matrix, 0, Eigen::OuterStride<>> H, Eigen::Ref<Vector> b) const {
  const Eigen::Matrix<double, 3, 2> B = basis();
  // Residual of the tilt: up - up_measured, in the tangent plane spanned by hat(up) B.
  const Eigen::Matrix<double, 3, 2> D = hat(up_) * B;
  const double tilt_weight = 1.0 / (tilt.sigma * tilt.sigma);
  H.block<2, 2>(kTilt, kTilt) += tilt_weight * D.transpose() * D;
  b.segment<2>(kTilt) += tilt_weight * D.transpose() * (up_ - tilt.up);
  const double gyro_weight = 1.0 / (prior.bias_gyro_sigma * prior.bias_gyro_sigma);
  const double accel_weight = 1.0 / (prior.bias_accel_sigma * prior.bias_accel_sigma);
  H.diagonal().segment<3>(kBiasGyro).array() += gyro_weight;
  H.diagonal().segment<3>(kBiasAccel).array() += accel_weight;
  b.segment<3>(kBiasGyro) += gyro_weight * (bias_gyro_ - prior.bias_gyro);
  b.segment<3>(kBiasAccel) += accel_weight * (bias_accel_ - prior.bias_accel);
}

double StartParameters::priorCost(const TiltEstimate& tilt, const StartPrior& prior) const {
  return (up_ - tilt.up).squaredNorm() / (tilt.sigma * tilt.sigma) +
         (bias_gyro_ - prior.bias_gyro).squaredNorm() / (prior.bias_gyro_sigma * prior.bias_gyro_sigma) +
         (bias_accel_ - prior.bias_accel).squaredNorm() / (prior.bias_accel_sigma * prior.bias_accel_sigma);
}

void StartParameters::retract(const Vector& step) {
  const Eigen::Vector3d phi = basis() * step.segment<2>(kTilt);
  up_ = (expSo3(-phi) * up_).normalized();
  velocity_ += step.segment<3>(kVelocity);
  bias_gyro_ += step.segment<3>(kBiasGyro);
  bias_accel_ += step.segment<3>(kBiasAccel);
}

void StartParameters::toMotionStart(const Matrix& covariance, MotionStart& start) const {
  start.up = up_;
  start.velocity = velocity_;
  start.bias_gyro = bias_gyro_;
  start.bias_accel = bias_accel_;
  Eigen::Matrix<double, 12, kSize> J = Eigen::Matrix<double, 12, kSize>::Zero();
  J.block<3, 2>(0, kTilt) = basis();
  J.block<3, 3>(3, kVelocity).setIdentity();
  J.block<6, 6>(6, kBiasGyro).setIdentity();
  start.covariance = J * covariance * J.transpose();
  const Eigen::Matrix2d tilt = covariance.block<2, 2>(kTilt, kTilt);
  const Eigen::Matrix3d velocity = covariance.block<3, 3>(kVelocity, kVelocity);
  start.tilt_sigma = std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(tilt).eigenvalues()[1]);
  start.velocity_sigma = std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(velocity).eigenvalues()[2]);
}

}  // namespace swiftlet
