#pragma once
// The variables of the smoother and their error states.
//
// Order of the error state, here and everywhere: phi (0-2), p (3-5), v (6-8), bg (9-11), ba (12-14).
// Rotation is perturbed on the right, R <- R Exp(phi); the rest adds. A pose-only state (a keyframe
// whose velocity and biases have been marginalized) has the first six. A slot takes 3.5 kB.

#include <Eigen/Core>
#include <cstdint>

#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"
#include "estimator/imu/preintegration.hpp"
#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/noise_in_use.hpp"
#include "estimator/messages/odometry_output.hpp"
#include "estimator/messages/scan_motion.hpp"

namespace swiftlet {

inline constexpr int kPoseDim = 6;
using Vector15d = Eigen::Matrix<double, kStateDim, 1>;

/// One body state's values.
struct BodyState {
  SE3 T_world_body;                                        ///< m
  Eigen::Vector3d v_world_body = Eigen::Vector3d::Zero();  ///< m/s, world axes
  Eigen::Vector3d bias_gyro = Eigen::Vector3d::Zero();     ///< rad/s, body axes
  Eigen::Vector3d bias_accel = Eigen::Vector3d::Zero();    ///< m/s^2, body axes

  /// x <- x [+] delta.
  void retract(const Vector15d& delta);
  /// this [-] reference: the delta that takes `reference` here; rotation part shorter than pi.
  [[nodiscard]] Vector15d minus(const BodyState& reference) const;
};

/// How a state hangs on the state before it.
enum class LinkKind : std::uint8_t {
  kNone,              ///< the oldest state with velocity and biases
  kImu,               ///< preintegrated samples
  kConstantVelocity,  ///< the samples have a gap: velocity is assumed to persist, loosely
};

/// A slot of the window.
struct WindowState {
  bool used = false;
  Stamp stamp;  ///< on the IMU's clock
  std::uint64_t frame_index = 0;
  bool keyframe = false;
  std::uint32_t rest = 0;  ///< number of the rest that the state is part of; 0: none
  bool has_motion = true;  ///< velocity and biases are still variables
  bool frozen = false;     ///< the prior touches it: Jacobians are taken at `moved_estimate`
  BodyState x;
  BodyState first_estimate;  ///< the prior's reference
  BodyState moved_estimate;  ///< first_estimate, moved with the window (Window::moveEstimates)
  LinkKind link = LinkKind::kNone;
  Preintegration imu;        ///< from the previous state with motion, when link is kImu
  ImuFactors imu_factors;    ///< on the noise that imu was integrated with
  double link_duration = 0;  ///< s
  double time_offset = 0;    ///< s, camera-to-IMU offset at which `stamp` was placed on the IMU's clock
  Eigen::Vector3d omega_body = Eigen::Vector3d::Zero();  ///< rad/s at the stamp
  ScanTurn scan;                                         ///< of the image's rows
  int offset = -1;                                       ///< first column in the normal equations
  int factor_offset = -1;                                ///< first column in the factor of the last solve
  int factor_dimension = 0;                              ///< columns there
  Health health = Health::kInitializing;
  Matrix15d covariance = Matrix15d::Zero();  ///< marginal, as last computed
  FrameStatistics statistics;

  [[nodiscard]] int dimension() const { return has_motion ? kStateDim : kPoseDim; }
  /// Where Jacobians are taken (first-estimate Jacobians).
  [[nodiscard]] const BodyState& linearization() const { return frozen ? moved_estimate : x; }
};

}  // namespace swiftlet
