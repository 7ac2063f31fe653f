#pragma once
// The pixel noise of a run's tracks, from their own residuals.
//
// A rolling shutter, stamps that jitter or a poor calibration add errors to every track that no gate removes.
// Weighted as if they were noise of the size assumed, they outweigh the IMU and the estimate follows them.
// Median of the squared residuals of a frame's sightings, outliers included, low pass. It begins with the
// noise that the settings give and stays between kLeast and kMostRaised times of it: errors that last
// (track_correlation.hpp) hide in the fit, so that residuals alone do not bound them from below.
// O(1), no memory.

#include <algorithm>
#include <cmath>

namespace swiftlet {

class PixelNoise {
 public:
  /// From 0.45 px, the default: 6.75 px, as motion blur makes it.
  static constexpr double kMostRaised = 15.0;
  /// From 0.45 px 0.25 px: by so much and up to 0.29 px are tracks of rendered flights off the truth.
  static constexpr double kLeast = 1 / 1.8;
  /// Fewer sightings of a frame say nothing.
  static constexpr int kFewestSightings = 20;

  explicit PixelNoise(double sigma) : usual_(sigma), square_(sigma * sigma) {}

  /// px, 1 sigma of a coordinate.
  [[nodiscard]] double sigma() const {
    return std::clamp(std::sqrt(square_), kLeast * usual_, kMostRaised * usual_);
  }

  /// `median_square`: of the residuals' squared norms, in the noise in use. `seconds` since the last call.
  void update(double median_square, double seconds) {
    constexpr double kAverageTime = 2.0;      // s
    constexpr double kMedianOfChi2 = 1.3863;  // of two unit variances: 2 ln 2
    const double most = kMostRaised * usual_;
    const double now = std::min(sigma() * sigma() * median_square / kMedianOfChi2, most * most);
    square_ += (1 - std::exp(-seconds / kAverageTime)) * (now - square_);
  }

 private:
  double usual_;
  double square_;
};

}  // namespace swiftlet
