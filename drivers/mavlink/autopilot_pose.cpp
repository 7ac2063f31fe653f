#include "drivers/mavlink/autopilot_pose.hpp"

#include <cmath>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Matrix6x15d = Eigen::Matrix<double, 6, kStateDim>;

constexpr std::int64_t kNanosecondsPerMicrosecond = 1000;
// Positions of blocks in the state's error.
constexpr int kPhi = 0;
constexpr int kPosition = 3;
constexpr int kVelocity = 6;
constexpr int kBiasGyro = 9;

/// Converts between z up and z down; for rotations it is applied on both sides.
Vector3d toFrd(const Vector3d& v) { return {v.x(), -v.y(), -v.z()}; }

mavlink::Covariance21 pack(const Matrix6d& flu) {
  const Eigen::DiagonalMatrix<double, 6> M(1, -1, -1, 1, -1, -1);
  const Matrix6d frd = M * flu * M;
  mavlink::Covariance21 packed{};
  std::size_t next = 0;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) packed[next++] = static_cast<float>(frd(row, column));
  }
  return packed;
}

/// Covariance of position and of rotation about the world's axes, from that of the error state.
Matrix6d poseCovariance(const NavState& state, const Vector3d& lever) {
  const Matrix3d R = state.T_world_body.R();
  Matrix6x15d A = Matrix6x15d::Zero();
  A.block<3, 3>(0, kPosition).setIdentity();
  A.block<3, 3>(0, kPhi) = -R * hat(lever);
  A.block<3, 3>(3, kPhi) = R;
  return A * state.covariance * A.transpose();
}

/// Covariance of the velocity in the vehicle's axes and of its angular rates, whose error is that of the
/// bias.
Matrix6d velocityCovariance(const NavState& state, const Matrix3d& R_vehicle_body) {
  const Matrix3d R_body_world = state.T_world_body.R().transpose();
  Matrix6x15d A = Matrix6x15d::Zero();
  A.block<3, 3>(0, kVelocity) = R_vehicle_body * R_body_world;
  A.block<3, 3>(0, kPhi) = R_vehicle_body * hat(Vector3d(R_body_world * state.v_world_body));
  A.block<3, 3>(3, kBiasGyro) = -R_vehicle_body;
  return A * state.covariance * A.transpose();
}

Vector3d positionOf(const NavState& state, const AutopilotMounting& mounting) {
  return toFrd(state.T_world_body * mounting.p_body_vehicle);
}

Eigen::Quaterniond attitudeOf(const NavState& state, const AutopilotMounting& mounting) {
  const Eigen::Quaterniond q = state.T_world_body.rotation * mounting.q_vehicle_body.conjugate();
  return {q.w(), q.x(), -q.y(), -q.z()};
}

std::uint64_t microseconds(Stamp stamp) {
  return static_cast<std::uint64_t>(stamp.ns / kNanosecondsPerMicrosecond);
}

}  // namespace

mavlink::Odometry odometryOf(const NavState& state, const Vector3d& omega_body,
                             const AutopilotMounting& mounting) {
  const Matrix3d R_vehicle_body = mounting.q_vehicle_body.toRotationMatrix();
  const Vector3d v_body = state.T_world_body.rotation.conjugate() * state.v_world_body +
                          omega_body.cross(mounting.p_body_vehicle);
  const Eigen::Quaterniond q = attitudeOf(state, mounting);
  mavlink::Odometry message;
  message.time_usec = microseconds(state.stamp);
  message.position = positionOf(state, mounting).cast<float>();
  message.q = {static_cast<float>(q.w()), static_cast<float>(q.x()), static_cast<float>(q.y()),
               static_cast<float>(q.z())};
  message.velocity = toFrd(R_vehicle_body * v_body).cast<float>();
  message.rates = toFrd(R_vehicle_body * omega_body).cast<float>();
  message.pose_covariance = pack(poseCovariance(state, mounting.p_body_vehicle));
  message.velocity_covariance = pack(velocityCovariance(state, R_vehicle_body));
  message.reset_counter = static_cast<std::uint8_t>(state.epoch);
  message.quality = qualityOf(state.health);
  return message;
}

mavlink::VisionPositionEstimate positionEstimateOf(const NavState& state, const AutopilotMounting& mounting) {
  const Matrix3d R = attitudeOf(state, mounting).toRotationMatrix();
  mavlink::VisionPositionEstimate message;
  message.usec = microseconds(state.stamp);
  message.position = positionOf(state, mounting).cast<float>();
  // R = Rz(yaw) Ry(pitch) Rx(roll).
  message.rpy =
      Eigen::Vector3d(std::atan2(R(2, 1), R(2, 2)), std::atan2(-R(2, 0), std::hypot(R(0, 0), R(1, 0))),
                      std::atan2(R(1, 0), R(0, 0)))
          .cast<float>();
  message.covariance = pack(poseCovariance(state, mounting.p_body_vehicle));
  message.reset_counter = static_cast<std::uint8_t>(state.epoch);
  return message;
}

std::int8_t qualityOf(Health health) {
  constexpr std::int8_t kGood = 100;
  // Above the usual thresholds of autopilots, and visibly lower than kGood.
  constexpr std::int8_t kDegraded = 40;
  switch (health) {
    case Health::kGood:
      return kGood;
    case Health::kDegraded:
      return kDegraded;
    case Health::kFailed:
      return mavlink::Odometry::kFailed;
    case Health::kInitializing:
      break;
  }
  return 0;
}

}  // namespace swiftlet
