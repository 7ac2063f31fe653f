#pragma once
// The IMU's noise model: continuous densities as in calibration files, and an inflation for errors that
// calibrations at rest do not include (vibration, scale, misalignment).

#include "estimator/messages/noise_in_use.hpp"

namespace swiftlet {

struct ImuNoise {
  double gyro_density = 1.7e-4;   ///< rad/s/sqrt(Hz)
  double accel_density = 2.0e-3;  ///< m/s^2/sqrt(Hz)
  double gyro_walk = 2.0e-5;      ///< rad/s^2/sqrt(Hz)
  double accel_walk = 3.0e-3;     ///< m/s^3/sqrt(Hz)
  double rate_hz = 200;
  double gravity = 9.81;          ///< m/s^2; gravity in world axes is (0, 0, -gravity)
  double gyro_saturation = 34.9;  ///< rad/s (2000 deg/s); readings at or beyond count as saturated
  double accel_saturation = 156;  ///< m/s^2 (16 g)

  [[nodiscard]] ImuNoise times(const ImuFactors& factors) const {
    ImuNoise noise = *this;
    noise.gyro_density *= factors.gyro;
    noise.accel_density *= factors.accel;
    return noise;
  }
};

}  // namespace swiftlet
