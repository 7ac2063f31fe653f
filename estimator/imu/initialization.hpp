#pragma once
// The state at the first image: tilt from the accelerometer.
//
// Convention: `up` is the unit vector in body axes along which an accelerometer at rest reads +gravity (world
// z in body axes). Tilt error phi: R_true = R Exp(phi), up_true = Exp(-phi) up. The start in motion with one
// camera is in mono_start.hpp. All functions are deterministic and do not allocate.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>

#include "estimator/core/stamp.hpp"
#include "estimator/core/status.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

/// Prior before any data: the biases of MEMS sensors.
struct StartPrior {
  Eigen::Vector3d bias_gyro = Eigen::Vector3d::Zero();   ///< rad/s
  Eigen::Vector3d bias_accel = Eigen::Vector3d::Zero();  ///< m/s^2
  double bias_gyro_sigma = 0.1;                          ///< rad/s
  double bias_accel_sigma = 0.12;                        ///< m/s^2
};

struct TiltEstimate {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  ///< unit, body axes at the requested stamp
  double sigma = 0;                               ///< rad, per axis
  double duration = 0;                            ///< s of samples used
};

/// R_world_body: the attitude with world z along `up` that is nearest to identity.
Eigen::Quaterniond gravityAlignedRotation(const Eigen::Vector3d& up);

/// Tilt at `at` from the `samples` up to it, at most the last second: the mean specific force, each reading
/// rotated to `at` by the gyro (minus prior.bias_gyro). Sigma is from the scatter of the force, limited
/// to 2..6 degrees. kInvalidInput without a sample, kDegenerate if the mean force is below half of gravity
/// (free fall).
Status estimateTilt(std::span<const ImuSample> samples, Stamp at, const ImuNoise& noise,
                    const StartPrior& prior, TiltEstimate& tilt);

}  // namespace swiftlet
