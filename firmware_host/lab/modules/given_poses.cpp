#include "firmware_host/lab/modules/given_poses.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "drivers/input/input_error.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/evaluation/association.hpp"

namespace swiftlet {
namespace {

// No drone moves or rotates faster while it can see.
constexpr double kMaxSpeed = 20.0;     // m/s
constexpr double kMaxTurnRate = 20.0;  // rad/s
// Deviations of a pose from its neighbours up to this are no jump: at 1 kHz, millimetres of noise are metres
// per second.
constexpr double kFreeDistance = 0.05;  // m
constexpr double kFreeAngle = 0.05;     // rad

bool isJump(const TrajectoryPoint& a, const TrajectoryPoint& b) {
  const double seconds = (b.stamp - a.stamp).seconds();
  const double distance = (b.T_world_body.translation - a.T_world_body.translation).norm();
  const double angle = a.T_world_body.rotation.angularDistance(b.T_world_body.rotation);
  return distance > kFreeDistance + kMaxSpeed * seconds || angle > kFreeAngle + kMaxTurnRate * seconds;
}

}  // namespace

NamedTrajectory openTrajectory(const std::string& file, const std::string& log, const LogSource& source,
                               LogWarnings& warnings) {
  if (!file.empty()) {
    LogCounters counters;
    return {file, readTrajectory(file, counters, warnings)};
  }
  NamedTrajectory truth{source.groundTruthName(),
                        onImageClock(source.groundTruth(warnings), source.rig().camera_to_imu_shift)};
  if (truth.poses.empty()) {
    throw InputError(log, 0, "", "the log has no truth to take poses from",
                     "Give a trajectory file with --trajectory (TUM, or EuRoC csv)");
  }
  return truth;
}

GivenPoses::GivenPoses(NamedTrajectory trajectory, Duration max_gap)
    : name_(std::move(trajectory.name)), trajectory_(std::move(trajectory.poses)), max_gap_(max_gap) {
  for (std::size_t i = 1; i < trajectory_.size(); ++i) {
    if (isJump(trajectory_[i - 1], trajectory_[i])) jumps_.push_back(i);
  }
}

void GivenPoses::warnOfJumps(const char* what, LogWarnings& warnings) const {
  if (jumps_.empty()) return;
  warnings.add(fmt::format("{}: the poses jump {} times, first at {}: {}", name_, jumps_.size(),
                           formatSeconds(trajectory_[jumps_.front()].stamp), what));
}

void GivenPoses::failWithout(const char* what, Stamp first, Stamp last) const {
  throw InputError(
      name_, 0, "timestamp",
      fmt::format("no {} has a pose: the poses span {} to {}, the images {} to {}", what,
                  formatSeconds(trajectory_.front().stamp), formatSeconds(trajectory_.back().stamp),
                  formatSeconds(first), formatSeconds(last)),
      fmt::format("Both need stamps of one clock, and gaps between poses of at most --max-gap={:g} s",
                  max_gap_.seconds()));
}

std::optional<GivenPoses::Pose> GivenPoses::at(Stamp stamp) const {
  const std::optional<SE3> pose = interpolate(trajectory_, stamp, max_gap_);
  if (!pose) return std::nullopt;
  const auto after = std::ranges::lower_bound(trajectory_, stamp, {}, &TrajectoryPoint::stamp);
  const auto index = static_cast<std::size_t>(after - trajectory_.begin());
  const auto jump = std::ranges::lower_bound(jumps_, index);
  const bool across = after->stamp != stamp && jump != jumps_.end() && *jump == index;
  if (across) return std::nullopt;
  return Pose{*pose, static_cast<std::size_t>(std::ranges::upper_bound(jumps_, index) - jumps_.begin())};
}

ScanMotion GivenPoses::scanAt(Stamp stamp, Duration readout) const {
  if (readout.ns == 0) return {};
  const Duration half{readout.ns / 2};
  const auto before = at(stamp - half);
  const auto middle = at(stamp);
  const auto after = at(stamp + half);
  if (!before || !middle || !after) return {};
  const double seconds = half.seconds();
  const SE3& T = middle->T_world_body;
  ScanMotion motion;
  motion.turn.before = logSo3(before->T_world_body.rotation.conjugate() * T.rotation) / seconds;
  motion.turn.after = logSo3(T.rotation.conjugate() * after->T_world_body.rotation) / seconds;
  motion.v_body = T.rotation.conjugate() *
                  (after->T_world_body.translation - before->T_world_body.translation) / (2 * seconds);
  return motion;
}

}  // namespace swiftlet
