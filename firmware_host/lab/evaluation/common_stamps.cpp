#include "firmware_host/lab/evaluation/common_stamps.hpp"

#include <algorithm>

namespace swiftlet {

Trajectory atStampsOf(const Trajectory& estimate, const Trajectory& other) {
  Trajectory common;
  for (const TrajectoryPoint& point : estimate) {
    if (std::ranges::binary_search(other, point.stamp, {}, &TrajectoryPoint::stamp)) common.push_back(point);
  }
  return common;
}

CommonStamps compareAtCommonStamps(const Trajectory& reference, const Trajectory& other,
                                   const Trajectory& truth, const AccuracyOptions& options) {
  const Association a = associate(atStampsOf(reference, other), truth, options.association);
  const Association b = associate(atStampsOf(other, reference), truth, options.association);
  CommonStamps result;
  result.pairs = a.pairs.size();
  result.reference_rmse = trajectoryError(a.pairs, options.align).translation.rmse;
  result.other_rmse = trajectoryError(b.pairs, options.align).translation.rmse;
  return result;
}

}  // namespace swiftlet
