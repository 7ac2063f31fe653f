#include "estimator/imu/initialization.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

// Older readings are less useful, because the gyro's unknown bias rotates them (4 degrees in 1 s at 0.08
// rad/s).
constexpr double kLongestMean = 1.0;  // s
// Sigma of the tilt: at least that from the accelerometer's bias, at most that of hard manoeuvres.
constexpr double kDegree = 0.017453292519943295;
constexpr double kLeastTiltSigma = 2.0 * kDegree;
constexpr double kMostTiltSigma = 6.0 * kDegree;
// Acceleration changes over some tenths of a second: readings within this time count as one.
constexpr double kAccelerationTime = 0.3;  // s
// In a short window, scatter does not show acceleration that stays constant.
constexpr double kLeastAcceleration = 0.45;  // m/s^2, RMS per axis of hand-held and flown starts
constexpr double kLeastForceShare = 0.5;     // of gravity: below it the body is falling

}  // namespace

Eigen::Quaterniond gravityAlignedRotation(const Eigen::Vector3d& up) {
  // The half-way quaternion (1 + up.z, up x z), singular only for a body upside down.
  const double w = 1.0 + up.z();
  if (w < 1e-9) return {0, 1, 0, 0};
  return Eigen::Quaterniond(w, up.y(), -up.x(), 0).normalized();
}

Status estimateTilt(std::span<const ImuSample> samples, Stamp at, const ImuNoise& noise,
                    const StartPrior& prior, TiltEstimate& tilt) {
  // Backwards from `at`: R rotates the axes of a reading to those at `at`.
  Eigen::Quaterniond R = Eigen::Quaterniond::Identity();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double sum_of_squares = 0;
  double count = 0;
  Stamp later = at;
  for (std::size_t i = samples.size(); i-- > 0;) {
    const ImuSample& sample = samples[i];
    if (sample.stamp > at) continue;
    if ((at - sample.stamp).seconds() > kLongestMean) break;
    const Eigen::Vector3d turn = (later - sample.stamp).seconds() * (sample.gyro - prior.bias_gyro);
    R = R * expSo3(-turn);
    later = sample.stamp;
    const Eigen::Vector3d force = R * (sample.accel - prior.bias_accel);
    sum += force;
    sum_of_squares += force.squaredNorm();
    count += 1;
  }
  if (count == 0) return {StatusCode::kInvalidInput, "no IMU sample before the first image"};
  const Eigen::Vector3d mean = sum / count;
  if (mean.norm() < kLeastForceShare * noise.gravity) {
    return {StatusCode::kDegenerate, "mean specific force far below gravity: falling"};
  }
  const double variance = std::max(0.0, sum_of_squares / count - mean.squaredNorm()) / 3.0;
  tilt.up = mean.normalized();
  tilt.duration = (at - later).seconds();
  const double independent = 1.0 + tilt.duration / kAccelerationTime;
  const double manoeuvre =
      std::sqrt((variance + kLeastAcceleration * kLeastAcceleration) / independent) / noise.gravity;
  const double excess = std::abs(mean.norm() - noise.gravity) / noise.gravity;  // visible acceleration
  const double sigma = std::hypot(manoeuvre, excess, prior.bias_accel_sigma / noise.gravity);
  tilt.sigma = std::clamp(sigma, kLeastTiltSigma, kMostTiltSigma);
  return okStatus();
}

}  // namespace swiftlet
