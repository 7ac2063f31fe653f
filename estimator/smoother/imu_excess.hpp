#pragma once
// Estimates the factor by which the errors of gyro and accelerometer exceed their noise model in a flight.
//
// Vibration, g-sensitivity, scale and misalignment are not in the noise densities of data sheets. If they are
// ignored, they pull the estimate away from the images. Their size follows from the disagreement of IMU and
// images after smoothing (motionResiduals). Smoothing absorbs a part: with noise f times the configured one,
// a share f^2 / (f^2 + kImages) of a link's mean square remains. kImages is the variance that the images
// leave undetermined, in units of the configured noise variance. The factor only increases the noise,
// low-pass filtered. O(1), no memory.

#include <algorithm>
#include <cmath>

#include "estimator/messages/noise_in_use.hpp"

namespace swiftlet {

/// Mean squares of a whitened coordinate.
struct MotionResiduals {
  double all = 0;    ///< relative to the noise in use
  double gyro = 0;   ///< of rotations in the last seconds, relative to the configured noise; 0: too few
  double accel = 0;  ///< of velocities in the last seconds, relative to the configured noise
};

class ImuExcess {
 public:
  static constexpr double kMostRaised = 30.0;

  [[nodiscard]] const ImuFactors& factors() const { return factors_; }

  /// `seconds` since the last call.
  void update(const MotionResiduals& residuals, double seconds) {
    update(residuals.gyro, seconds, factors_.gyro);
    update(residuals.accel, seconds, factors_.accel);
  }

 private:
  static void update(double mean_square, double seconds, double& factor) {
    constexpr double kAverageTime = 2.0;  // s
    constexpr double kImages = 3.0;       // a quarter remains at f = 1; 0.12 to 0.19 measured at f = 1
    const double square = factor * factor;
    const double now = std::clamp(mean_square * (1 + kImages / square), 1.0, kMostRaised * kMostRaised);
    factor = std::sqrt(square + (1 - std::exp(-seconds / kAverageTime)) * (now - square));
  }

  ImuFactors factors_;
};

}  // namespace swiftlet
