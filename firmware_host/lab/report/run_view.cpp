#include "firmware_host/lab/report/run_view.hpp"

#include <algorithm>

#include "estimator/core/units.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/evaluation/yaw_rotation.hpp"

namespace swiftlet {
namespace {

PoseErrors errorsOf(const RunView& view, const Association& pairs) {
  // Fitted to the attitudes themselves: the fit of the positions is inaccurate over a short path.
  Eigen::Matrix3d turns = Eigen::Matrix3d::Zero();
  for (const PosePair& pair : pairs.pairs) turns += pair.truth.R() * pair.estimate.R().transpose();
  const Eigen::Quaterniond turn = yawRotation(turns);
  PoseErrors errors;
  for (const PosePair& pair : pairs.pairs) {
    errors.t.push_back(view.files.seconds(pair.stamp));
    errors.distance.push_back((pair.truth.translation - view.fit * pair.estimate.translation).norm());
    const Eigen::Quaterniond left = pair.truth.rotation.conjugate() * turn * pair.estimate.rotation;
    errors.degrees.push_back(logSo3(left).norm() * kToDegrees);
  }
  return errors;
}

Trajectory duringFlight(const Trajectory& truth, const RunFiles& files) {
  Trajectory flown;
  for (const TrajectoryPoint& point : truth) {
    if (point.stamp >= files.first_image && point.stamp <= files.last_image) flown.push_back(point);
  }
  return flown;
}

void compareKeyframes(RunView& view, const Trajectory& truth) {
  std::vector<ConsistencySample> samples;
  for (const StoredState& state : view.files.states) {
    const std::optional<SE3> pose = interpolate(truth, state.stamp, view.max_gap);
    if (!pose) continue;
    samples.push_back({state.T_world_body, *pose, state.covariance});
    view.error_stamps.push_back(state.stamp);
  }
  view.keyframe_errors = consistencyErrors(samples);
}

}  // namespace

RunView viewOf(RunFiles files, const Trajectory& truth, const std::string& truth_name,
               const AccuracyOptions& options) {
  RunView view;
  view.files = std::move(files);
  view.max_gap = options.association.max_gap;
  if (truth.empty()) return view;
  const Association pairs = associate(view.files.odometry, truth, options.association);
  if (pairs.pairs.empty()) {
    view.files.missing.push_back({truth_name, "no pose of the run has truth at its stamp"});
    return view;
  }
  AccuracyOptions yaw = options;
  yaw.align = AlignKind::kYaw;
  view.odometry = accuracyOf(view.files.odometry, truth, yaw);
  view.fit = view.odometry.absolute.alignment;
  view.truth_name = truth_name;
  view.odometry_errors = errorsOf(view, pairs);
  view.map_errors = errorsOf(view, associate(view.files.map, truth, options.association));
  compareKeyframes(view, truth);
  const SE3 T_world_truth = view.fit.T_to_from.inverse();
  view.truth = duringFlight(truth, view.files);
  for (TrajectoryPoint& point : view.truth) {
    point.T_world_body = T_world_truth * point.T_world_body;
    point.v_world_body = T_world_truth.rotation * point.v_world_body;
  }
  return view;
}

}  // namespace swiftlet
