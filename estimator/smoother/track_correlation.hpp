#pragma once
// How much longer than an image the errors of tracks last, from their residuals at neighbouring keyframes.
//
// A patch that is found beside its place is found there in the next keyframe too: what is averaged over a
// track's sightings is known less well than their number says. The residuals' correlation r from one keyframe
// to the next is 0 where errors are independent (a little less: a point is fitted to them) and some 0.3 to
// 0.5 on images. For a constant seen at equal times the variance is (1 + r) / (1 - r) times that of
// independent sightings (an autoregressive error of first order); the part that a landmark's point takes up
// does no harm, so poses get 1 / (1 - r). On eleven rendered flights that makes their NEES 6.
// The factor is for covariances that are given out; weights stay as they are. O(1), no memory.

#include <algorithm>
#include <cmath>

namespace swiftlet {

class TrackCorrelation {
 public:
  static constexpr double kMost = 0.75;  ///< of the correlation: a factor of 4

  [[nodiscard]] double correlation() const {
    return square_ > 0 ? std::clamp(product_ / square_, 0.0, kMost) : 0.0;
  }
  /// Of a pose's variance.
  [[nodiscard]] double varianceFactor() const { return 1.0 / (1.0 - correlation()); }

  /// Residuals of the same points at two keyframes: the sum of their products, and of their mean squares.
  /// `seconds` since the last call.
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
