#include "firmware_host/lab/evaluation/association.hpp"

#include <algorithm>

namespace swiftlet {

std::optional<SE3> interpolate(const Trajectory& truth, Stamp stamp, Duration max_gap) {
  const auto after = std::ranges::lower_bound(truth, stamp, {}, &TrajectoryPoint::stamp);
  if (after == truth.end()) return std::nullopt;
  if (after->stamp == stamp) return after->T_world_body;
  if (after == truth.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const Duration gap = after->stamp - before->stamp;
  if (gap > max_gap) return std::nullopt;
  const double ratio = static_cast<double>((stamp - before->stamp).ns) / static_cast<double>(gap.ns);
  const SE3& a = before->T_world_body;
  const SE3& b = after->T_world_body;
  return SE3(a.rotation.slerp(ratio, b.rotation), a.translation + ratio * (b.translation - a.translation));
}

Association associate(const Trajectory& estimate, const Trajectory& truth,
                      const AssociationOptions& options) {
  Association result;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    const TrajectoryPoint& point = estimate[i];
    if (!options.inSection(point.stamp)) continue;
    ++result.estimates;
    const std::optional<SE3> truth_pose = interpolate(truth, point.stamp, options.max_gap);
    if (truth_pose) {
      result.pairs.push_back({point.stamp, point.T_world_body, *truth_pose, i});
    } else {
      ++result.without_truth;
    }
  }
  return result;
}

}  // namespace swiftlet
