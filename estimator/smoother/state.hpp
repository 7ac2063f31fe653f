#pragma once
// The variables of the smoother and their error states.
//
// Order of the error state everywhere: phi (0-2), p (3-5), v (6-8), bg (9-11), ba (12-14). Rotation is
// perturbed on the right, R <- R Exp(phi); the others are added. A pose-only state (a keyframe whose velocity
// and biases have been marginalized) has the first six. A slot takes 3.4 kB.

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

/// Values of a body state.
struct BodyState {
  SE3 T_world_body;                                        ///< m
  Eigen::Vector3d v_world_body = Eigen::Vector3d::Zero();  ///< m/s, world axes
  Eigen::Vector3d bias_gyro = Eigen::Vector3d::Zero();     ///< rad/s, body axes
  Eigen::Vector3d bias_accel = Eigen::Vector3d::Zero();    ///< m/s^2, body axes

  /// x <- x [+] delta.
  void retract(const Vector15d& delta);
  /// this [-] reference: the delta from `reference` to this; its rotation is shorter than pi.
  [[nodiscard]] Vector15d minus(const BodyState& reference) const;
};

/// How a state is linked to the previous one.
enum class LinkKind : std::uint8_t {
  kNone,              ///< the oldest state with velocity and biases
  kImu,               ///< preintegrated samples
  kConstantVelocity,  ///< the samples have a gap: velocity is assumed constant, with a large sigma
};

/// A slot of the window.
struct WindowState {
  bool used = false;
  Stamp stamp;  ///< on the IMU's clock
  std::uint64_t frame_index = 0;
  bool keyframe = false;
  std::uint32_t rest = 0;  ///< number of the rest that the state belongs to; 0: in motion
  bool has_motion = true;  ///< velocity and biases are variables
  BodyState x;
  LinkKind link = LinkKind::kNone;
  Preintegration imu;        ///< from the previous state with motion, if link is kImu
  ImuFactors imu_factors;    ///< factors on the noise with which `imu` was integrated
  double link_duration = 0;  ///< s
  double time_offset = 0;    ///< s, camera-to-IMU offset with which `stamp` was converted to the IMU's clock
  Eigen::Vector3d omega_body = Eigen::Vector3d::Zero();  ///< rad/s at the stamp
  ScanTurn scan;                                         ///< rotation during the rows of the image
  int offset = -1;                                       ///< first column in the normal equations
  int factor_offset = -1;                                ///< first column in the factor of the last solve
  int factor_dimension = 0;                              ///< number of columns there
  Health health = Health::kInitializing;
  Matrix15d covariance = Matrix15d::Zero();  ///< marginal covariance, as last computed
  FrameStatistics statistics;

  [[nodiscard]] int dimension() const { return has_motion ? kStateDim : kPoseDim; }
};

}  // namespace swiftlet
