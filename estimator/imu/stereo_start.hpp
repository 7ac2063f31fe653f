#pragma once
// Start in motion with metric positions: velocity, tilt and biases from stereo poses and the IMU.
//
// Model (frame 0 = body at the first image; g along -up):
//   p_k = o + v t_k - gravity up t_k^2 / 2 + alpha_k(bg, ba) + noise,   R_k = dR_k(bg) Exp(noise)
// with alpha_k, dR_k preintegrated from 0 to k, o the first position's own error. Unknowns: o (3),
// v (3), tilt (2, gravity's magnitude is known), bg (3), ba (3), with priors on tilt and biases.
// Gauss-Newton from the accelerometer tilt (linear but for the sphere and the biases); 14 unknowns, a few
// iterations, about 90 us for 10 frames. Frames: body axes at the first image. Source: reference equation 4:
// Mur-Artal, Tardos, RA-L 2017 (linear visual-inertial alignment) with gravity on the sphere as in Qin, Shen,
// IROS 2017.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <span>

#include "estimator/core/status.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/imu/initialization.hpp"
#include "estimator/imu/preintegration.hpp"

namespace swiftlet {

using Matrix12d = Eigen::Matrix<double, 12, 12>;

/// Frames that a start may use: 1 s at 30 Hz.
inline constexpr std::size_t kMaxStartFrames = 32;

/// Image k >= 1 of the start relative to image 0 (which is not listed).
struct StartFrame {
  const Preintegration* from_first = nullptr;                    ///< image 0 to k
  Eigen::Vector3d position = Eigen::Vector3d::Zero();            ///< p_body0_body(k) [m]
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  ///< R_body0_body(k)
  double position_sigma = 0.003;                                 ///< m, per axis
  double rotation_sigma = 0.002;  ///< rad, per axis; <= 0: the rotation was not measured
};

/// The state at image 0. Error order of the covariance: phi, v, bg, ba; phi has no part along `up`
/// (yaw is gauge).
struct MotionStart {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();        ///< unit, body axes at image 0
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();   ///< m/s, body axes at image 0
  Eigen::Vector3d bias_gyro = Eigen::Vector3d::Zero();  ///< rad/s
  Eigen::Vector3d bias_accel = Eigen::Vector3d::Zero();
  Matrix12d covariance = Matrix12d::Zero();
  double tilt_sigma = 0;      ///< rad: the larger principal sigma of phi
  double velocity_sigma = 0;  ///< m/s: the largest principal sigma
  double residual_rms = 0;    ///< whitened; about 1 when the model holds
};

/// kNotReady with fewer than 3 frames, kDegenerate when the equations do not determine the state,
/// kNumerical when the iteration fails.
Status solveStereoStart(std::span<const StartFrame> frames, const TiltEstimate& tilt, const ImuNoise& noise,
                        const StartPrior& prior, MotionStart& start);

/// The start as a state: world origin at image 0, yaw by gravityAlignedRotation.
NavState toNavState(const MotionStart& start, Stamp at, const StartPrior& prior);

}  // namespace swiftlet
