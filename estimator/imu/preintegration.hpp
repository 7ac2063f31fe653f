#pragma once
// On-manifold IMU preintegration between two states.
//
// The motion increment of raw samples between stamps i and j, independent of the states at i and j, with its
// covariance and its first-order dependence on the biases:
//   dR = R_i^T R_j,  dv = R_i^T (v_j - v_i - g dt),  dp = R_i^T (p_j - p_i - v_i dt - g dt^2 / 2)
// with g = (0, 0, -gravity) in world axes.
// Order of the 9-vector: phi, p, v (as in the state). Units: rad, m, m/s.
// Scheme: samples are linear between their stamps; rotation by the mean rate of the interval, specific force
// at its middle attitude (second order in the step). Internally the rotation error is in the axes of i (theta
// = dR phi): the transition is then identity except for skew blocks, and isotropic noise needs no rotation.
// Time not covered by samples: for a gap or a held reading of n > 1.5 periods the noise variance is
// multiplied by n^2. Beyond 10 periods attitude is held and the force is that of the ends of the gap, with
// the noise of an unknown motion (integration_rule.hpp). The noise of saturated readings is multiplied by
// 100.
// Cost: about 0.15 us per sample. Memory: 1.2 kB. No allocation.
// Source: Forster, Carlone, Dellaert, Scaramuzza, "On-Manifold Preintegration for Real-Time
// Visual-Inertial Odometry", T-RO 2017 (arXiv 1512.02363), equations 26-38, A.7-A.10 (with the
// midpoint rule in place of Euler's).

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>

#include "estimator/core/stamp.hpp"
#include "estimator/core/status.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/gyro_intrinsics.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Vector9d = Eigen::Matrix<double, 9, 1>;

class Preintegration {
 public:
  Preintegration() = default;
  Preintegration(const ImuNoise& noise, const Eigen::Vector3d& bias_gyro, const Eigen::Vector3d& bias_accel,
                 const GyroIntrinsics& intrinsics = {});

  /// Appends `dt` seconds (> 0) with these mean values of rate and specific force. The factors multiply the
  /// noise variances.
  void integrate(double dt, const Eigen::Vector3d& gyro, const Eigen::Vector3d& accel, double gyro_factor = 1,
                 double accel_factor = 1);

  /// Appends [from, to] from samples ordered by stamp. Readings at the ends are linearly interpolated, or
  /// held if there is no sample beyond. kInvalidInput without samples.
  Status integrate(std::span<const ImuSample> samples, Stamp from, Stamp to);

  [[nodiscard]] double duration() const { return duration_; }         ///< s
  [[nodiscard]] double gapDuration() const { return gap_duration_; }  ///< s, part of it without samples
  [[nodiscard]] const Eigen::Vector3d& biasGyro() const { return bias_gyro_; }
  [[nodiscard]] const Eigen::Vector3d& biasAccel() const { return bias_accel_; }
  /// Mean rate of the readings [rad/s]. With it a change of the intrinsics acts like a change of the bias:
  /// exact to first order for rotation, and for position and velocity at constant rate.
  [[nodiscard]] Eigen::Vector3d meanGyro() const {
    const double covered = duration_ - gap_duration_;
    return covered > 0 ? Eigen::Vector3d(gyro_integral_ / covered) : Eigen::Vector3d::Zero();
  }
  [[nodiscard]] Matrix9d covariance() const;

  /// The gyro bias that gives the increment of `intrinsics` and `bias`, to first order.
  [[nodiscard]] Eigen::Vector3d biasFor(const GyroIntrinsics& intrinsics, const Eigen::Vector3d& bias) const {
    return bias + (intrinsics.matrix - intrinsics_.matrix) * meanGyro();
  }

  /// Increments at other biases than those of the construction, to first order.
  [[nodiscard]] Eigen::Quaterniond deltaRotation(const Eigen::Vector3d& bias_gyro) const;
  [[nodiscard]] Eigen::Vector3d deltaVelocity(const Eigen::Vector3d& bias_gyro,
                                              const Eigen::Vector3d& bias_accel) const;
  [[nodiscard]] Eigen::Vector3d deltaPosition(const Eigen::Vector3d& bias_gyro,
                                              const Eigen::Vector3d& bias_accel) const;
  [[nodiscard]] Eigen::Quaterniond deltaRotation() const { return rotation_; }
  [[nodiscard]] const Eigen::Vector3d& deltaVelocity() const { return velocity_; }
  [[nodiscard]] const Eigen::Vector3d& deltaPosition() const { return position_; }

  /// d(phi, p, v) / d bias; the phi rows are zero for the accelerometer.
  [[nodiscard]] Eigen::Matrix<double, 9, 3> jacobianGyro() const;
  [[nodiscard]] Eigen::Matrix<double, 9, 3> jacobianAccel() const;

 private:
  void bridgeGap(double dt, const Eigen::Vector3d& accel);
  void propagateCovariance(double dt, const Eigen::Vector3d& force, double gyro_variance,
                           double accel_variance);

  // Blocks of the symmetric covariance of (theta, p, v), theta in the axes of i.
  struct Blocks {
    Eigen::Matrix3d theta_theta = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d p_theta = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d v_theta = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d p_p = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d p_v = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d v_v = Eigen::Matrix3d::Zero();
  };

  ImuNoise noise_;
  Eigen::Vector3d bias_gyro_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d bias_accel_ = Eigen::Vector3d::Zero();
  GyroIntrinsics intrinsics_;
  Eigen::Vector3d gyro_integral_ = Eigen::Vector3d::Zero();  // of the readings
  double duration_ = 0;
  double gap_duration_ = 0;
  Eigen::Quaterniond rotation_ = Eigen::Quaterniond::Identity();
  Eigen::Vector3d velocity_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d position_ = Eigen::Vector3d::Zero();
  Blocks cov_;
  Eigen::Matrix3d theta_gyro_ = Eigen::Matrix3d::Zero();  // d theta / d gyro bias, and so on
  Eigen::Matrix3d p_gyro_ = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d v_gyro_ = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d p_accel_ = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d v_accel_ = Eigen::Matrix3d::Zero();
};

}  // namespace swiftlet
