#pragma once
// What an Allan variance says of a sensor's noise.
//
// Model: sigma^2(tau) = 3 Q^2 / tau^2 + N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3: quantization (slope -1),
// white noise (-1/2), bias instability (0), random walk (+1/2). N is always there; the others only where the
// likelihood asks for them.
// Likelihood: the variance of each octave is taken as a mean of squares over its disjoint pairs of clusters.
// For white noise these are the Haar wavelet's coefficients, which are independent within and between
// octaves, so that the standard deviations are those of the estimate. The overlapping variance is the better
// value, and its overlap is not counted as information.
// The shortest octaves are left out where a sensor's own filter makes them smaller than white noise.
// Sources: IEEE Std 952-1997, annex C; Percival and Guttorp, "Long-memory processes, the Allan variance and
// wavelets", 1994.

#include <optional>
#include <vector>

#include "firmware_host/lab/calibrate/imu_noise/allan_variance.hpp"

namespace swiftlet {

struct NoiseValue {
  double value = 0;
  double sigma = 0;
};

/// A random walk that is known to less than this part of itself is not given as a value.
inline constexpr double kMostRelativeSigma = 0.3;

struct AxisNoise {
  NoiseValue density;                ///< N: reading / sqrt(Hz)
  std::optional<NoiseValue> walk;    ///< K: reading / s / sqrt(Hz); empty: the log is too short for it
  double walk_limit = 0;             ///< K is below this (2 sigma); where it has no value
  double instability = 0;            ///< lowest deviation / 0.664, in readings
  double instability_tau = 0;        ///< s, where that is
  bool instability_reached = false;  ///< the deviation rises behind it
  double quantization = 0;           ///< Q: reading s; 0: none was found
  double from_tau = 0;               ///< s: shorter clusters were left out of the fit
  double misfit = 1;                 ///< of the model, in sigmas RMS; `sigma` includes it above 1
  std::vector<double> model;         ///< fitted deviation at the points' tau
};

/// `axis`: 0 to 5. Needs at least four points.
[[nodiscard]] AxisNoise fitNoise(const std::vector<AllanPoint>& points, int axis);

}  // namespace swiftlet
