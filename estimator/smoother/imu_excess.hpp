#pragma once
// By how much the gyro and the accelerometer of a flight err more than their noise model says.
//
// Vibration, g-sensitivity, scale and misalignment are in no data sheet's noise density; weighted as if they
// were not there, they pull the estimate from the images. How large they are shows in what IMU and images
// disagree by after smoothing (motionResiduals). Smoothing takes its part: with a noise f times as told, a
// share f^2 / (f^2 + kImages) of a link's mean square is left, kImages being what the images leave open of
// it, in variances of the noise as told. The factor only raises the noise, as a low pass. O(1), no memory.

#include <algorithm>
#include <cmath>

#include "estimator/messages/noise_in_use.hpp"

namespace swiftlet {

/// Mean squares of a whitened coordinate.
struct MotionResiduals {
  double all = 0;    ///< in the noise in use, rest included
  double gyro = 0;   ///< of rotations over the last seconds in the noise as told; 0 while there are too few
  double accel = 0;  ///< of velocities, likewise
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
    constexpr double kImages = 3.0;  // a quarter is left at f = 1; 0.12 to 0.19 of noise as told were seen
    const double square = factor * factor;
    const double now = std::clamp(mean_square * (1 + kImages / square), 1.0, kMostRaised * kMostRaised);
    factor = std::sqrt(square + (1 - std::exp(-seconds / kAverageTime)) * (now - square));
  }

  ImuFactors factors_;
};

}  // namespace swiftlet
