#include "firmware_host/lab/evaluation/loop_accuracy.hpp"

#include <vector>

#include "estimator/core/median.hpp"
#include "estimator/core/units.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet {

LoopAccuracy loopAccuracy(std::span<const MapLoop> loops, const Trajectory& truth,
                          const AssociationOptions& options) {
  LoopAccuracy out;
  std::vector<double> distances;
  std::vector<double> turns;
  for (const MapLoop& loop : loops) {
    if (!options.inSection(loop.new_stamp)) continue;
    const std::optional<SE3> old_pose = interpolate(truth, loop.old_stamp, options.max_gap);
    const std::optional<SE3> new_pose = interpolate(truth, loop.new_stamp, options.max_gap);
    if (!old_pose || !new_pose) {
      ++out.without_truth;
      continue;
    }
    const SE3 error = (old_pose->inverse() * *new_pose).inverse() * loop.T_old_new;
    const double distance = error.translation.norm();
    const double degrees = logSo3(error.rotation).norm() * kToDegrees;
    const bool right = distance <= kFalseLoopDistance && degrees <= kFalseLoopDegrees;
    const bool selected = loop.verdict == LoopVerdict::kSelected;
    ++out.verified;
    out.selected += selected ? 1 : 0;
    if (!right) continue;
    ++out.verified_right;
    out.selected_right += selected ? 1 : 0;
    distances.push_back(distance);
    turns.push_back(degrees);
  }
  if (!distances.empty()) {
    out.median_distance = medianOf(distances);
    out.median_degrees = medianOf(turns);
  }
  return out;
}

}  // namespace swiftlet
