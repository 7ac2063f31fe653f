#pragma once
// The unknowns of a start in motion, and the poses computed from them.
//
// In body axes at image 0: velocity v, tilt (up on the sphere), biases. With the IMU they give the pose at
// every later instant: p = v t - gravity up t^2 / 2 + alpha(bg, ba), R = dR(bg).

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "estimator/imu/initialization.hpp"
#include "estimator/imu/preintegration.hpp"

namespace swiftlet {

using Matrix12d = Eigen::Matrix<double, 12, 12>;

/// The state at image 0. Order of the covariance: phi, v, bg, ba; phi has no component along `up`, because
/// yaw is not observable.
struct MotionStart {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();        ///< unit, body axes at image 0
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();   ///< m/s, body axes at image 0
  Eigen::Vector3d bias_gyro = Eigen::Vector3d::Zero();  ///< rad/s
  Eigen::Vector3d bias_accel = Eigen::Vector3d::Zero();
  Matrix12d covariance = Matrix12d::Zero();
  double tilt_sigma = 0;      ///< rad, the larger principal sigma of phi
  double velocity_sigma = 0;  ///< m/s, the largest principal sigma
  double residual_rms = 0;    ///< whitened; about 1 if the model holds
};

/// Pose of the body relative to image 0, with derivatives with respect to the unknowns.
struct StartPose {
  Eigen::Vector3d position;
  Eigen::Quaterniond rotation;
  Eigen::Matrix<double, 3, 11> d_position;
  Eigen::Matrix3d d_rotation;  ///< right error phi by the gyro bias
};

class StartParameters {
 public:
  static constexpr int kVelocity = 0;
  static constexpr int kTilt = 3;  // two, along the tangent basis of `up`
  static constexpr int kBiasGyro = 5;
  static constexpr int kBiasAccel = 8;
  static constexpr int kSize = 11;
  using Vector = Eigen::Matrix<double, kSize, 1>;
  using Matrix = Eigen::Matrix<double, kSize, kSize>;

  StartParameters(const Eigen::Vector3d& up, const StartPrior& prior)
      : up_(up), bias_gyro_(prior.bias_gyro), bias_accel_(prior.bias_accel) {}

  [[nodiscard]] StartPose poseAt(const Preintegration& imu, double gravity) const;
  /// Adds the priors on tilt and biases to the normal equations H x = -b.
  void addPrior(const TiltEstimate& tilt, const StartPrior& prior,
                Eigen::Ref<Matrix, 0, Eigen::OuterStride<>> H, Eigen::Ref<Vector> b) const;
  /// Cost of the priors (sum of whitened squares).
  [[nodiscard]] double priorCost(const TiltEstimate& tilt, const StartPrior& prior) const;
  void setUp(const Eigen::Vector3d& up) { up_ = up; }
  void retract(const Vector& step);
  void toMotionStart(const Matrix& covariance, MotionStart& start) const;

  [[nodiscard]] const Eigen::Vector3d& up() const { return up_; }
  [[nodiscard]] const Eigen::Vector3d& velocity() const { return velocity_; }
  [[nodiscard]] const Eigen::Vector3d& biasGyro() const { return bias_gyro_; }

 private:
  /// Two unit vectors across `up`: the axes of the tilt unknowns.
  [[nodiscard]] Eigen::Matrix<double, 3, 2> basis() const;

  Eigen::Vector3d up_;
  Eigen::Vector3d velocity_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d bias_gyro_;
  Eigen::Vector3d bias_accel_;
};

}  // namespace swiftlet
