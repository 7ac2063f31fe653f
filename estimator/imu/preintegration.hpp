#pragma once
// On-manifold IMU preintegration between two states.
//
// What: the motion increment that raw samples imply between stamps i and j, independent of the
// states at i and j, with its covariance and its first-order dependence on the biases:
//   dR = R_i^T R_j,  dv = R_i^T (v_j - v_i - g dt),  dp = R_i^T (p_j - p_i - v_i dt - g dt^2 / 2)
// with g = (0, 0, -gravity) in world axes.
// Order of the 9-vector: phi, p, v (as in the state). Units: rad, m, m/s.
// Scheme: samples are taken as linear between their stamps; rotation by the interval's mean rate,
// specific force at the interval's middle attitude (second order in the step).
// Cost: about 0.5 us a sample; memory 1.2 kB. Nothing is allocated.
// Source: Forster, Carlone, Dellaert, Scaramuzza, "On-Manifold Preintegration for Real-Time
// Visual-Inertial Odometry", T-RO 2017 (arXiv 1512.02363), equations 26-38, A.7-A.10 (with the
// midpoint rule in place of Euler's).

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>

#include "estimator/core/stamp.hpp"
#include "estimator/core/status.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Vector9d = Eigen::Matrix<double, 9, 1>;

class Preintegration {
 public:
  Preintegration() = default;
  Preintegration(const ImuNoise& noise, const Eigen::Vector3d& bias_gyro, const Eigen::Vector3d& bias_accel);

  /// Appends `dt` seconds (> 0) over which rate and specific force had these mean values.
  void integrate(double dt, const Eigen::Vector3d& gyro, const Eigen::Vector3d& accel);

  /// Appends [from, to] from samples in order of their stamps; readings at the ends are linearly
  /// interpolated, or held where no sample lies beyond. kInvalidInput without any sample.
  Status integrate(std::span<const ImuSample> samples, Stamp from, Stamp to);

  [[nodiscard]] double duration() const { return duration_; }  ///< s
  [[nodiscard]] const Eigen::Vector3d& biasGyro() const { return bias_gyro_; }
  [[nodiscard]] const Eigen::Vector3d& biasAccel() const { return bias_accel_; }
  [[nodiscard]] const Matrix9d& covariance() const { return covariance_; }

  /// Increments at biases that differ from those of the construction, to first order.
  [[nodiscard]] Eigen::Quaterniond deltaRotation(const Eigen::Vector3d& bias_gyro) const;
  [[nodiscard]] Eigen::Vector3d deltaVelocity(const Eigen::Vector3d& bias_gyro,
                                              const Eigen::Vector3d& bias_accel) const;
  [[nodiscard]] Eigen::Vector3d deltaPosition(const Eigen::Vector3d& bias_gyro,
                                              const Eigen::Vector3d& bias_accel) const;
  [[nodiscard]] Eigen::Quaterniond deltaRotation() const { return rotation_; }
  [[nodiscard]] const Eigen::Vector3d& deltaVelocity() const { return velocity_; }
  [[nodiscard]] const Eigen::Vector3d& deltaPosition() const { return position_; }

  /// d(phi, p, v) / d bias; the phi rows of the accelerometer's are zero.
  [[nodiscard]] const Eigen::Matrix<double, 9, 3>& jacobianGyro() const { return jacobian_gyro_; }
  [[nodiscard]] const Eigen::Matrix<double, 9, 3>& jacobianAccel() const { return jacobian_accel_; }

 private:
  double gyro_variance_density_ = 0;
  double accel_variance_density_ = 0;
  Eigen::Vector3d bias_gyro_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d bias_accel_ = Eigen::Vector3d::Zero();
  double duration_ = 0;
  Eigen::Quaterniond rotation_ = Eigen::Quaterniond::Identity();
  Eigen::Vector3d velocity_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d position_ = Eigen::Vector3d::Zero();
  Matrix9d covariance_ = Matrix9d::Zero();
  Eigen::Matrix<double, 9, 3> jacobian_gyro_ = Eigen::Matrix<double, 9, 3>::Zero();
  Eigen::Matrix<double, 9, 3> jacobian_accel_ = Eigen::Matrix<double, 9, 3>::Zero();
};

}  // namespace swiftlet
