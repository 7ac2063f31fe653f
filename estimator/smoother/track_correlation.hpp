#pragma once
// Estimates the temporal correlation of the errors of tracks from their residuals at neighbouring keyframes.
//
// A patch that is matched at a wrong position is matched there in the next keyframe too, so averages over the
// observations of a track are less accurate than their number suggests. The correlation r of residuals from
// one keyframe to the next is 0 for independent errors (slightly less, because a point is fitted to them) and
// about 0.3 to 0.5 on images. For a constant observed at equal intervals the variance is (1 + r) / (1 - r)
// times that of independent observations (an autoregressive error of first order). The part absorbed by a
// landmark's point does no harm, so poses get the factor 1 / (1 - r). With it the NEES of eleven rendered
// flights is 6. The factor applies to output covariances; weights do not change. O(1), no memory.

#include <algorithm>
#include <cmath>

namespace swiftlet {

class TrackCorrelation {
 public:
  static constexpr double kMost = 0.75;  ///< largest correlation: a factor of 4

  [[nodiscard]] double correlation() const {
    return square_ > 0 ? std::clamp(product_ / square_, 0.0, kMost) : 0.0;
  }
  /// Factor on the variance of a pose.
  [[nodiscard]] double varianceFactor() const { return 1.0 / (1.0 - correlation()); }

  /// Adds residuals of the same points at two keyframes: the sum of their products, and the sum of their mean
  /// squares. `seconds`: time since the last call.
  void update(double product, double square, double seconds) {
    constexpr double kAverageTime = 5.0;  // s
    const double share = 1 - std::exp(-seconds / kAverageTime);
    product_ += share * (product - product_);
    square_ += share * (square - square_);
  }

 private:
  double product_ = 0;
  double square_ = 0;
};

}  // namespace swiftlet
