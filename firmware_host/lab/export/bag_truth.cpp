#include "firmware_host/lab/evaluation/trajectory_error.hpp"
#include "firmware_host/lab/export/run_bag.hpp"

namespace swiftlet {

BagTruth truthBeside(const RunFolder& run, const Trajectory& truth) {
  BagTruth beside;
  const Association association = associate(run.odometry, truth, {});
  if (association.pairs.empty()) return beside;
  const TrajectoryError error = trajectoryError(association.pairs, AlignKind::kYaw);
  SE3 T_truth_world = error.alignment.T_to_from;
  if (!error.status.ok()) {
    const PosePair& middle = association.pairs[association.pairs.size() / 2];
    T_truth_world = middle.truth * middle.estimate.inverse();
  }
  beside.T_world_truth = T_truth_world.inverse();
  for (const TrajectoryPoint& point : truth) {
    if (point.stamp < run.odometry.front().stamp || point.stamp > run.odometry.back().stamp) continue;
    beside.poses.push_back(point);
  }
  return beside;
}

}  // namespace swiftlet
