#pragma once
// Fits a model of a sensor's noise to its Allan variance.
//
// Model: sigma^2(tau) = 3 Q^2 / tau^2 + N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3: quantization (slope -1),
// white noise (-1/2), bias instability (0), random walk (+1/2). N is always included; the others only if the
// likelihood requires them. Likelihood: the variance of each octave is treated as a mean of squares over its
// disjoint pairs of clusters. For white noise these are Haar wavelet coefficients, which are independent
// within and between octaves, so the standard deviations are those of the estimate. The overlapping variance
// is the better value, and its overlap is not counted as information. The shortest octaves are omitted if the
// sensor's own filter makes them smaller than white noise. Sources: IEEE Std 952-1997, annex C; Percival and
// Guttorp, "Long-memory processes, the Allan variance and wavelets", 1994.

#include <optional>
#include <vector>

#include "firmware_host/lab/calibrate/imu_noise/allan_variance.hpp"

namespace swiftlet {

struct NoiseValue {
  double value = 0;
  double sigma = 0;
};

/// A random walk with a larger relative sigma is not reported as a value.
inline constexpr double kMostRelativeSigma = 0.3;

struct AxisNoise {
  NoiseValue density;                ///< N: reading / sqrt(Hz)
  std::optional<NoiseValue> walk;    ///< K: reading / s / sqrt(Hz); empty: the log is too short for it
  double walk_limit = 0;             ///< upper limit of K (2 sigma), if it has no value
  double instability = 0;            ///< lowest deviation / 0.664, in readings
  double instability_tau = 0;        ///< s, tau of that deviation
  bool instability_reached = false;  ///< the deviation rises again beyond it
  double quantization = 0;           ///< Q: reading s; 0: not found
  double from_tau = 0;               ///< s: shorter clusters were not used for the fit
  double misfit = 1;                 ///< of the model, in sigmas RMS; included in `sigma` if above 1
  std::vector<double> model;         ///< fitted deviation at the points' tau
};

/// `axis`: 0 to 5. Needs at least four points.
[[nodiscard]] AxisNoise fitNoise(const std::vector<AllanPoint>& points, int axis);

}  // namespace swiftlet
