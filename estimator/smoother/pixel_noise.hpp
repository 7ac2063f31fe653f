#pragma once
// Estimates the pixel noise of the tracks from their residuals.
//
// A rolling shutter, jitter of stamps or a poor calibration add errors to every track that no gate removes.
// With the weights of the assumed noise they would outweigh the IMU and distort the estimate. The noise is
// estimated from the median of the squared residuals of a frame's observations, outliers included, low-pass
// filtered. It starts at the configured noise and stays between kLeast and kMostRaised times that value,
// because correlated errors (track_correlation.hpp) are hidden in the fit and residuals alone would
// underestimate them. O(1), no memory.

#include <algorithm>
#include <cmath>

namespace swiftlet {

class PixelNoise {
 public:
  /// Upper limit: 6.75 px for the default of 0.45 px, as caused by motion blur.
  static constexpr double kMostRaised = 15.0;
  /// Lower limit: 0.25 px for the default of 0.45 px. The errors of tracks in rendered flights are 0.25 to
  /// 0.29 px.
  static constexpr double kLeast = 1 / 1.8;
  /// Smallest number of observations of a frame for an update.
  static constexpr int kFewestSightings = 20;

  explicit PixelNoise(double sigma) : usual_(sigma), square_(sigma * sigma) {}

  /// px, standard deviation of a coordinate.
  [[nodiscard]] double sigma() const {
    return std::clamp(std::sqrt(square_), kLeast * usual_, kMostRaised * usual_);
  }

  /// `median_square`: median of the squared norms of residuals, in the noise in use. `seconds` since the last
  /// call.
  void update(double median_square, double seconds) {
    constexpr double kAverageTime = 2.0;      // s
    constexpr double kMedianOfChi2 = 1.3863;  // with two components of unit variance: 2 ln 2
    const double most = kMostRaised * usual_;
    const double now = std::min(sigma() * sigma() * median_square / kMedianOfChi2, most * most);
    square_ += (1 - std::exp(-seconds / kAverageTime)) * (now - square_);
  }

 private:
  double usual_;
  double square_;
};

}  // namespace swiftlet
