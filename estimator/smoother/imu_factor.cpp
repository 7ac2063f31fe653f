#include "estimator/smoother/imu_factor.hpp"

#include <Eigen/Cholesky>
#include <cmath>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

// Possible motion of a vehicle during a gap in the samples: standard deviations of a constant acceleration
// and a constant angular rate.
constexpr double kGapAcceleration = 3.0;  // m/s^2
constexpr double kGapRate = 1.0;          // rad/s

void biasWalk(double duration, const ImuNoise& noise, const BodyState& x_i, const BodyState& x_j,
              MotionFactor& factor) {
  const double gyro = 1.0 / (noise.gyro_walk * std::sqrt(duration));
  const double accel = 1.0 / (noise.accel_walk * std::sqrt(duration));
  factor.residual.segment<3>(9) = gyro * (x_j.bias_gyro - x_i.bias_gyro);
  factor.residual.segment<3>(12) = accel * (x_j.bias_accel - x_i.bias_accel);
  factor.jacobian_j.block<3, 3>(9, 9) = gyro * Eigen::Matrix3d::Identity();
  factor.jacobian_i.block<3, 3>(9, 9) = -gyro * Eigen::Matrix3d::Identity();
  factor.jacobian_j.block<3, 3>(12, 12) = accel * Eigen::Matrix3d::Identity();
  factor.jacobian_i.block<3, 3>(12, 12) = -accel * Eigen::Matrix3d::Identity();
}

Eigen::Vector3d gravityVector(const ImuNoise& noise) { return {0, 0, -noise.gravity}; }

}  // namespace

bool imuFactor(const Preintegration& imu, const ImuNoise& noise, const BodyState& x_i, const BodyState& x_j,
               MotionFactor& factor, const GyroIntrinsicsState* intrinsics) {
  const double dt = imu.duration();
  if (!(dt > 0)) return false;
  const Eigen::Vector3d bias_gyro =
      intrinsics == nullptr ? x_i.bias_gyro : imu.biasFor(intrinsics->now(), x_i.bias_gyro);
  const Eigen::Vector3d g = gravityVector(noise);

  const Eigen::Matrix3d R_i_t = x_i.T_world_body.R().transpose();
  const Eigen::Matrix3d R_j = x_j.T_world_body.R();
  const Eigen::Vector3d r_phi = logSo3(imu.deltaRotation(bias_gyro).conjugate() *
                                       x_i.T_world_body.rotation.conjugate() * x_j.T_world_body.rotation);
  const Eigen::Matrix3d jr_inverse = rightJacobianInverseSo3(r_phi);
  const Eigen::Vector3d moved = R_i_t * (x_j.T_world_body.translation - x_i.T_world_body.translation -
                                         x_i.v_world_body * dt - 0.5 * dt * dt * g);
  const Eigen::Vector3d gained = R_i_t * (x_j.v_world_body - x_i.v_world_body - g * dt);
  Vector9d r;
  r << r_phi, moved - imu.deltaPosition(bias_gyro, x_i.bias_accel),
      gained - imu.deltaVelocity(bias_gyro, x_i.bias_accel);

  Eigen::Matrix<double, 9, 15> J_i = Eigen::Matrix<double, 9, 15>::Zero();
  Eigen::Matrix<double, 9, 15> J_j = Eigen::Matrix<double, 9, 15>::Zero();
  J_i.block<3, 3>(0, 0) = -jr_inverse * R_j.transpose() * R_i_t.transpose();
  const Eigen::Matrix3d gyro_to_phi = imu.jacobianGyro().topRows<3>();
  J_i.block<3, 3>(0, 9) = -jr_inverse * expSo3Matrix(r_phi).transpose() *
                          rightJacobianSo3(gyro_to_phi * (bias_gyro - imu.biasGyro())) * gyro_to_phi;
  J_j.block<3, 3>(0, 0) = jr_inverse;
  J_i.block<3, 3>(3, 0) = hat(moved);
  J_i.block<3, 3>(3, 3) = -R_i_t;
  J_i.block<3, 3>(3, 6) = -dt * R_i_t;
  J_i.block<3, 3>(3, 9) = -imu.jacobianGyro().middleRows<3>(3);
  J_i.block<3, 3>(3, 12) = -imu.jacobianAccel().middleRows<3>(3);
  J_j.block<3, 3>(3, 3) = R_i_t;
  J_i.block<3, 3>(6, 0) = hat(gained);
  J_i.block<3, 3>(6, 6) = -R_i_t;
  J_i.block<3, 3>(6, 9) = -imu.jacobianGyro().bottomRows<3>();
  J_i.block<3, 3>(6, 12) = -imu.jacobianAccel().bottomRows<3>();
  J_j.block<3, 3>(6, 6) = R_i_t;

  const Eigen::LLT<Matrix9d> llt(imu.covariance());
  if (llt.info() != Eigen::Success) return false;
  factor.jacobian_i.setZero();
  factor.jacobian_j.setZero();
  factor.residual.head<9>() = llt.matrixL().solve(r);
  factor.jacobian_i.topRows<9>() = llt.matrixL().solve(J_i);
  factor.jacobian_j.topRows<9>() = llt.matrixL().solve(J_j);
  factor.with_gyro = intrinsics != nullptr && intrinsics->estimated();
  if (factor.with_gyro) {
    for (int c = 0; c < 3; ++c) {
      factor.jacobian_gyro_matrix.middleCols<3>(3 * c) =
          imu.meanGyro()[c] * factor.jacobian_i.block<9, 3>(0, 9);
    }
  }
  biasWalk(dt, noise, x_i, x_j, factor);
  return true;
}

bool constantVelocityFactor(double duration, const ImuNoise& noise, const BodyState& x_i,
                            const BodyState& x_j, MotionFactor& factor) {
  if (!(duration > 0)) return false;
  const double phi = 1.0 / (kGapRate * duration);
  const double v = 1.0 / (kGapAcceleration * duration);
  const double p = 2.0 / (kGapAcceleration * duration * duration);
  factor.jacobian_i.setZero();
  factor.jacobian_j.setZero();
  const Eigen::Vector3d turn = logSo3(x_i.T_world_body.rotation.conjugate() * x_j.T_world_body.rotation);
  factor.residual.segment<3>(0) = phi * turn;
  factor.residual.segment<3>(3) = p * (x_j.T_world_body.translation - x_i.T_world_body.translation -
                                       0.5 * duration * (x_i.v_world_body + x_j.v_world_body));
  factor.residual.segment<3>(6) = v * (x_j.v_world_body - x_i.v_world_body);
  const Eigen::Matrix3d jr_inverse = rightJacobianInverseSo3(turn);
  factor.jacobian_j.block<3, 3>(0, 0) = phi * jr_inverse;
  factor.jacobian_i.block<3, 3>(0, 0) = -phi * jr_inverse * expSo3Matrix(turn).transpose();
  factor.jacobian_j.block<3, 3>(3, 3) = p * Eigen::Matrix3d::Identity();
  factor.jacobian_i.block<3, 3>(3, 3) = -p * Eigen::Matrix3d::Identity();
  factor.jacobian_i.block<3, 3>(3, 6) = -0.5 * duration * p * Eigen::Matrix3d::Identity();
  factor.jacobian_j.block<3, 3>(3, 6) = -0.5 * duration * p * Eigen::Matrix3d::Identity();
  factor.jacobian_j.block<3, 3>(6, 6) = v * Eigen::Matrix3d::Identity();
  factor.jacobian_i.block<3, 3>(6, 6) = -v * Eigen::Matrix3d::Identity();
  biasWalk(duration, noise, x_i, x_j, factor);
  return true;
}

}  // namespace swiftlet
