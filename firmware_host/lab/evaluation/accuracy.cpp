#include "firmware_host/lab/evaluation/accuracy.hpp"

namespace swiftlet {

Accuracy accuracyOf(const Trajectory& estimate, const Trajectory& truth, const AccuracyOptions& options) {
  const Association association = associate(estimate, truth, options.association);
  Accuracy result;
  result.estimates = association.estimates;
  result.pairs = association.pairs.size();
  result.max_gap = options.association.max_gap;
  result.absolute = trajectoryError(association.pairs, options.align);
  if (association.pairs.empty()) return result;
  result.duration = (association.pairs.back().stamp - association.pairs.front().stamp).seconds();
  result.over_time = relativeErrorOverTime(association.pairs, options.rpe_delta);
  for (const double length : kSegmentLengths) {
    RelativeError error = relativeErrorOverDistance(association.pairs, length);
    if (error.translation.count > 0) result.over_distance.push_back(error);
  }
  return result;
}

}  // namespace swiftlet
