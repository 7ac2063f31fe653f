#pragma once
// Compares two estimates of one flight at the stamps of both: a map's keyframes with the causal poses of the
// same images. Errors at different stamps are not comparable (one estimate may include the start, or have
// more keyframes in fast parts).
//
// Both are restricted to common stamps (equal to the nanosecond) that have truth, and each is aligned
// separately. In time order. Cost O(poses log truths).

#include "firmware_host/lab/evaluation/accuracy.hpp"

namespace swiftlet {

/// The poses of `estimate` at stamps that `other` also has.
Trajectory atStampsOf(const Trajectory& estimate, const Trajectory& other);

struct CommonStamps {
  std::size_t pairs = 0;      ///< stamps with both estimates and truth
  double reference_rmse = 0;  ///< m, ATE
  double other_rmse = 0;
  /// Below 1, `other` is better; 0 if the reference has no error at all.
  [[nodiscard]] double ratio() const { return reference_rmse > 0 ? other_rmse / reference_rmse : 0; }
};

CommonStamps compareAtCommonStamps(const Trajectory& reference, const Trajectory& other,
                                   const Trajectory& truth, const AccuracyOptions& options);

}  // namespace swiftlet
