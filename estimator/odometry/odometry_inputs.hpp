#pragma once
// What the odometry's stages share: the rig and the noise that they work with, and when the IMU counts as
// silent.

#include <algorithm>
#include <cstddef>

#include "estimator/camera/rig.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/odometry/odometry_settings.hpp"
#include "estimator/smoother/imu_buffer.hpp"

namespace swiftlet {

/// Samples that a stage keeps, before and between frames: 20 s at 200 Hz.
inline constexpr std::size_t kImuHistory = 4096;

/// The cameras that the settings ask for.
inline Rig rigInUse(Rig rig, const OdometrySettings& settings) {
  if (!settings.use_stereo) rig.camera_count = std::min<std::size_t>(rig.camera_count, 1);
  return rig;
}

/// The calibration's densities, as in flight.
inline ImuNoise inflatedNoise(const ImuNoise& noise, const OdometrySettings& settings) {
  return noise.times({settings.gyro_inflation, settings.accel_inflation});
}

/// No sample for so long before `stamp` that holding the last reading is no measurement.
inline bool isSilent(const ImuBuffer& imu, const ImuNoise& noise, Stamp stamp) {
  constexpr double kSilentPeriods = 5.0;
  return imu.empty() || (stamp - imu.newest().stamp).seconds() * noise.rate_hz > kSilentPeriods;
}

}  // namespace swiftlet
