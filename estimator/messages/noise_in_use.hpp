#pragma once
// The noise used for an estimate: the configured noise, adapted to the errors found in flight.

#include "estimator/messages/track_noise.hpp"

namespace swiftlet {

/// Factors on the IMU's white-noise densities, including the configured inflation.
struct ImuFactors {
  double gyro = 1;
  double accel = 1;
};

struct NoiseInUse {
  double pixel_sigma = kTrackPixelSigma;  ///< px, of a track's coordinate
  ImuFactors imu;
};

}  // namespace swiftlet
