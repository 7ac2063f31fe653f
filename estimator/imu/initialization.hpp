#pragma once
// First states: tilt from the accelerometer, and the full state of a body at rest.
//
// Convention: `up` is the unit vector in body axes along which a still accelerometer reads
// +gravity (world z seen from the body). Tilt error phi: R_true = R Exp(phi), up_true = Exp(-phi) up.
// The solves in motion are in stereo_start.hpp (positions known in metres) and mono_start.hpp.
// All functions are plain, deterministic and allocate nothing.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>

#include "estimator/core/stamp.hpp"
#include "estimator/core/status.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/imu/rest_detector.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "estimator/messages/nav_state.hpp"

namespace swiftlet {

/// What is known before any data: the biases of MEMS sensors and the gauge.
struct StartPrior {
  Eigen::Vector3d bias_gyro = Eigen::Vector3d::Zero();   ///< rad/s
  Eigen::Vector3d bias_accel = Eigen::Vector3d::Zero();  ///< m/s^2
  double bias_gyro_sigma = 0.1;                          ///< rad/s
  double bias_accel_sigma = 0.12;                        ///< m/s^2
  double gauge_sigma = 1e-4;                             ///< m and rad: first position and yaw
};

struct TiltEstimate {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  ///< unit, body axes at the asked stamp
  double sigma = 0;                               ///< rad, per axis
  double duration = 0;                            ///< s of samples used
};

/// The attitude with world z along `up` that turns least from identity. R_world_body.
Eigen::Quaterniond gravityAlignedRotation(const Eigen::Vector3d& up);

/// Tilt at `at` from all `samples` up to it: the mean specific force, each reading turned to `at`
/// by the gyro (less prior.bias_gyro). Sigma from the force's scatter about its mean, bounded to
/// 2..6 degrees. At most the last second is used. kInvalidInput without a sample,
/// kDegenerate when the mean force is below half of gravity (free fall).
Status estimateTilt(std::span<const ImuSample> samples, Stamp at, const ImuNoise& noise,
                    const StartPrior& prior, TiltEstimate& tilt);

/// The state of a body at rest, world origin at the body, yaw by gravityAlignedRotation: tilt from the
/// mean force, gyro bias from the mean rate, accelerometer bias along gravity only; covariance
/// with the correlation of tilt and horizontal accelerometer bias. kNotReady when not at rest.
Status initializeAtRest(const RestState& rest, Stamp at, const ImuNoise& noise, const StartPrior& prior,
                        NavState& state);

}  // namespace swiftlet
