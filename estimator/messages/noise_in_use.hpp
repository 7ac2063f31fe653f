#pragma once
// The noise that an estimate was made with, where the flight shows more than was told.

#include "estimator/messages/track_noise.hpp"

namespace swiftlet {

/// On the densities of the IMU's white noise, inflation included.
struct ImuFactors {
  double gyro = 1;
  double accel = 1;
};

struct NoiseInUse {
  double pixel_sigma = kTrackPixelSigma;  ///< px, of a track's coordinate
  ImuFactors imu;
};

}  // namespace swiftlet
