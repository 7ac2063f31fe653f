#pragma once
// Two estimates of one flight compared where both have a pose: a map's keyframes beside the causal poses of
// the same images. Errors over different stamps are not comparable (a start that only one of them has, more
// keyframes where the flight was quick).
//
// Both are restricted to the stamps that they share (equal to the nanosecond) and that have truth, and each
// is aligned by itself. In time order. Cost O(poses log truths).

#include "firmware_host/lab/evaluation/accuracy.hpp"

namespace swiftlet {

/// The poses of `estimate` at stamps that `other` has too.
Trajectory atStampsOf(const Trajectory& estimate, const Trajectory& other);

struct CommonStamps {
  std::size_t pairs = 0;      ///< stamps with both and truth
  double reference_rmse = 0;  ///< m, ATE
  double other_rmse = 0;
  /// Below 1 `other` is better; 0 when the reference has no error at all.
  [[nodiscard]] double ratio() const { return reference_rmse > 0 ? other_rmse / reference_rmse : 0; }
};

CommonStamps compareAtCommonStamps(const Trajectory& reference, const Trajectory& other,
                                   const Trajectory& truth, const AccuracyOptions& options);

}  // namespace swiftlet
