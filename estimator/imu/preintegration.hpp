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
// Inside, the rotation error is kept in the axes of i (theta = dR phi): the transition is then
// identity but for skew blocks, and isotropic noise needs no rotation.
// Not covered by samples: a hole or a held reading of n > 1.5 periods has its noise variance raised
// n^2-fold; beyond 10 periods it is a gap: attitude held, force that of the gap's ends, with the
// noise of an unknown motion (integration_rule.hpp). Saturated readings: noise raised 100-fold.
// Cost: about 0.15 us a sample; memory 1.2 kB. Nothing is allocated.
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

  /// Appends `dt` seconds (> 0) over which rate and specific force had these mean values. The factors
  /// multiply the noise variances.
  void integrate(double dt, const Eigen::Vector3d& gyro, const Eigen::Vector3d& accel, double gyro_factor = 1,
                 double accel_factor = 1);

  /// Appends [from, to] from samples in order of their stamps; readings at the ends are linearly
  /// interpolated, or held where no sample lies beyond. kInvalidInput without any sample.
  Status integrate(std::span<const ImuSample> samples, Stamp from, Stamp to);

  [[nodiscard]] double duration() const { return duration_; }         ///< s
  [[nodiscard]] double gapDuration() const { return gap_duration_; }  ///< s of it without samples
  [[nodiscard]] const Eigen::Vector3d& biasGyro() const { return bias_gyro_; }
  [[nodiscard]] const Eigen::Vector3d& biasAccel() const { return bias_accel_; }
  /// rad/s, of the readings: by it a change of the intrinsics acts as one of the bias does. Exact to first
  /// order for the rotation, and while the rate stays the same for position and velocity.
  [[nodiscard]] Eigen::Vector3d meanGyro() const {
    const double covered = duration_ - gap_duration_;
    return covered > 0 ? Eigen::Vector3d(gyro_integral_ / covered) : Eigen::Vector3d::Zero();
  }
  [[nodiscard]] Matrix9d covariance() const;

  /// The gyro bias at which this increment is that of `intrinsics` and `bias`, to first order.
  [[nodiscard]] Eigen::Vector3d biasFor(const GyroIntrinsics& intrinsics, const Eigen::Vector3d& bias) const {
    return bias + (intrinsics.matrix - intrinsics_.matrix) * meanGyro();
  }

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
