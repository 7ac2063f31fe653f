#pragma once
// Shared inputs of the odometry's stages: rig, noise, and the limit after which the IMU counts as silent.

#include <algorithm>
#include <cstddef>

#include "estimator/camera/rig.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/calibration_estimate.hpp"
#include "estimator/odometry/odometry_settings.hpp"
#include "estimator/smoother/imu_buffer.hpp"

namespace swiftlet {

/// Samples that a stage keeps before and between frames: 20 s at 200 Hz.
inline constexpr std::size_t kImuHistory = 4096;

/// How far the time shift can exceed its calibrated value if the settings enable its estimation.
inline Duration shiftMargin(const OdometrySettings& settings) {
  constexpr double kSigmas = 3.0;
  return Duration::fromSeconds(settings.estimate_time_offset ? kSigmas * kTimeOffsetPriorSigma : 0.0);
}

/// The rig with the cameras selected by the settings and the margins for what they estimate.
inline Rig rigInUse(Rig rig, const OdometrySettings& settings) {
  if (!settings.use_stereo) rig.camera_count = std::min<std::size_t>(rig.camera_count, 1);
  rig.shift_margin = shiftMargin(settings);
  return rig;
}

/// The calibration's densities, inflated for flight by the settings.
inline ImuNoise inflatedNoise(const ImuNoise& noise, const OdometrySettings& settings) {
  return noise.times({settings.gyro_inflation, settings.accel_inflation});
}

/// Whether samples were missing for so long before `stamp` that the last reading must not be held.
inline bool isSilent(const ImuBuffer& imu, const ImuNoise& noise, Stamp stamp) {
  constexpr double kSilentPeriods = 5.0;
  return imu.empty() || (stamp - imu.newest().stamp).seconds() * noise.rate_hz > kSilentPeriods;
}

}  // namespace swiftlet
