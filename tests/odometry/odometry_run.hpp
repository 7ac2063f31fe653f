#pragma once
// The odometry stage on a simulated flight's tracks, with the truth beside each state it gives.

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/geometry/alignment.hpp"
#include "estimator/geometry/so3.hpp"
#include "estimator/odometry/odometry.hpp"
#include "estimator/odometry/odometry_inputs.hpp"
#include "tests/smoother/track_flight.hpp"

namespace swiftlet::test {

/// One frame's outcome.
struct RunFrame {
  std::size_t index = 0;  ///< of the flight's frames
  double seconds = 0;     ///< since the flight's first frame
  bool has_state = false;
  NavState state;
  BodyState truth;
  FrameStatistics statistics;
  Doubt doubt = Doubt::kNone;
  CalibrationEstimate calibration;
};

/// Settings whose noise is the flight's own.
inline OdometrySettings settingsFor(const TrackFlight& flight, bool stereo = true) {
  OdometrySettings settings;
  settings.pixel_sigma = flight.flight().settings().tracks.pixel_sigma;
  settings.gyro_inflation = 1;
  settings.accel_inflation = 1;
  settings.use_stereo = stereo;
  return settings;
}

/// What the odometry says of a frame.
inline void take(const OdometryOutput& output, RunFrame& frame) {
  frame.has_state = output.has_state;
  frame.state = output.state;
  frame.statistics = output.statistics;
  frame.doubt = output.doubt;
  frame.calibration = output.calibration;
}

struct OdometryRun {
  std::vector<RunFrame> frames;
  std::vector<Event> events;
  std::optional<RunFrame> first_left;  ///< keyframe of the first epoch, as it left the window
};

/// `first`: frames and IMU samples before that frame are left out, but for `imu_before` seconds. `told`: the
/// noise figures that the odometry is given, `rig`: the calibration; none: the flight's own.
inline OdometryRun runOdometry(const TrackFlight& flight, const OdometrySettings& settings,
                               std::size_t first = 0, double imu_before = 0.5,
                               const std::optional<ImuNoise>& told = {}, const std::optional<Rig>& rig = {}) {
  OdometryRun run;
  Odometry odometry(rig.value_or(flight.rig()), told.value_or(flight.noise()), settings);
  const Stamp begin = flight.frames()[first].stamp - Duration::fromSeconds(imu_before);
  auto output = std::make_unique<OdometryOutput>();
  flight.play(
      [&](const ImuSample& sample) {
        if (sample.stamp >= begin) static_cast<void>(odometry.addImu(sample));
      },
      [&](std::size_t k) {
        if (k < first) return;
        static_cast<void>(odometry.smooth(flight.frames()[k], Effort{}, *output));
        RunFrame frame;
        frame.index = k;
        frame.seconds = flight.seconds(k) - flight.seconds(first);
        frame.truth = flight.truth(k);
        take(*output, frame);
        run.frames.push_back(frame);
        if (!run.first_left && !output->left_window.empty()) {
          const NavState& left = output->left_window[0].state;
          const auto& frames = flight.frames();
          const auto seen = std::ranges::find(frames, left.stamp, &TrackedFrame::stamp);
          if (seen != frames.end()) {
            run.first_left.emplace();
            run.first_left->state = left;
            run.first_left->truth = flight.truth(static_cast<std::size_t>(seen - frames.begin()));
          }
        }
        run.events.insert(run.events.end(), output->events.begin(), output->events.end());
      },
      rigInUse(rig.value_or(flight.rig()), settings).sampleLead());
  return run;
}

inline Eigen::Vector3d randomDirection(Random& random) {
  Eigen::Vector3d v;
  for (int k = 0; k < 3; ++k) v[k] = random.normal();
  return v.normalized();
}

/// Takes the truth into the estimate's world: the first pose's position and heading agree.
inline SE3 worldFromTruth(const RunFrame& first) {
  const SE3& estimate = first.state.T_world_body;
  const SE3& truth = first.truth.T_world_body;
  // Turn about the vertical that leaves no vertical part in the rotation error.
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  for (int iteration = 0; iteration < 5; ++iteration) {
    const Eigen::Vector3d error = logSo3(estimate.rotation * (turn * truth.rotation).conjugate());
    turn = expSo3(Eigen::Vector3d(0, 0, error.z())) * turn;
  }
  return {turn, estimate.translation - turn * truth.translation};
}

/// The same for the first epoch of a run that began at the flight's first frame, the world's origin. The
/// first pose will not do with one camera: it comes up to 2.6 s later, and its scale is hardly known. The
/// heading is that of the first keyframe that left the window.
inline std::optional<SE3> worldFromTruth(const OdometryRun& run, const RunFrame& frame) {
  if (!frame.has_state || frame.state.epoch != 0 || !run.first_left) return {};
  const Eigen::Quaterniond turn = worldFromTruth(*run.first_left).rotation;
  return SE3(turn, -(turn * run.frames.front().truth.T_world_body.translation));
}

/// Error of a frame's pose, in the order and frames of its covariance (phi body, p world).
inline Eigen::Matrix<double, 6, 1> poseError(const RunFrame& frame, const SE3& T_world_truth) {
  const SE3 truth = T_world_truth * frame.truth.T_world_body;
  Eigen::Matrix<double, 6, 1> error;
  error << logSo3(frame.state.T_world_body.rotation.conjugate() * truth.rotation),
      truth.translation - frame.state.T_world_body.translation;
  return error;
}

/// Angle between the estimated and the true vertical [rad].
inline double tiltError(const RunFrame& frame) {
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d estimate = frame.state.T_world_body.rotation.conjugate() * z;
  const Eigen::Vector3d truth = frame.truth.T_world_body.rotation.conjugate() * z;
  return std::atan2(estimate.cross(truth).norm(), estimate.dot(truth));
}

/// Difference of the velocities seen from the body [m/s].
inline double velocityError(const RunFrame& frame) {
  return (frame.state.T_world_body.rotation.conjugate() * frame.state.v_world_body -
          frame.truth.T_world_body.rotation.conjugate() * frame.truth.v_world_body)
      .norm();
}

/// ATE RMSE [m] after the best fit of pose, from `from` seconds on; NaN where there is none.
inline double ate(const std::vector<RunFrame>& frames, double from = 0) {
  std::vector<Eigen::Vector3d> estimate;
  std::vector<Eigen::Vector3d> truth;
  for (const RunFrame& f : frames) {
    if (!f.has_state || f.seconds < from) continue;
    estimate.push_back(f.state.T_world_body.translation);
    truth.push_back(f.truth.T_world_body.translation);
  }
  Alignment fit;
  return alignRigid(estimate, truth, fit).ok() ? fit.rms : std::nan("");
}

inline int count(const OdometryRun& run, EventKind kind) {
  return static_cast<int>(
      std::count_if(run.events.begin(), run.events.end(), [&](const Event& e) { return e.kind == kind; }));
}

inline SimulationSettings withFault(const SimulationSettings& settings, const Fault& fault) {
  SimulationSettings result = settings;
  result.faults.push_back(fault);
  return result;
}

}  // namespace swiftlet::test
