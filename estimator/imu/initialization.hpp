#pragma once
// What is known at the first image: tilt from the accelerometer.
//
// Convention: `up` is the unit vector in body axes along which a still accelerometer reads
// +gravity (world z seen from the body). Tilt error phi: R_true = R Exp(phi), up_true = Exp(-phi) up.
// The start in motion with one camera is in mono_start.hpp.
// All functions are plain, deterministic and allocate nothing.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>

#include "estimator/core/stamp.hpp"
#include "estimator/core/status.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

/// What is known before any data: the biases of MEMS sensors.
struct StartPrior {
  Eigen::Vector3d bias_gyro = Eigen::Vector3d::Zero();   ///< rad/s
  Eigen::Vector3d bias_accel = Eigen::Vector3d::Zero();  ///< m/s^2
  double bias_gyro_sigma = 0.1;                          ///< rad/s
  double bias_accel_sigma = 0.12;                        ///< m/s^2
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

}  // namespace swiftlet
