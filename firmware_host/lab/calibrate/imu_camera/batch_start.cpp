#include "firmware_host/lab/calibrate/imu_camera/batch_start.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/core/median.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/calibrate/cameras/board_pose.hpp"

namespace swiftlet {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr double kMostPoseRms = 10;    // px; a rolling shutter bends a board by some pixels
constexpr double kLongestTurn = 0.25;  // s between two poses: beyond, turns about changing axes do not add up
constexpr std::size_t kFewestPoses = 100;
// Least share of the camera's rotations that the gyro must explain. Poses from a board are accurate to 0.1
// deg, rotations by hand are some degrees in a tenth of a second: a matching gyro explains 0.99.
constexpr double kLeastExplained = 0.9;
constexpr double kMirrorSigmas = 5;  // gain 1/2 sigma^2
constexpr double kLeastTurn = 0.2;   // deg rms per turn; less means that the rig is at rest
// Distance of bias knots, as a share of the time after which the random walk equals the white noise.
constexpr double kBiasPart = 0.25;
constexpr int kMostBiasKnots = 4;

struct TimedPose {
  double time = 0;  ///< s, on the images' clock
  SE3 T_board_cam0;
};

std::vector<TimedPose> posesOf(const CalibrationTarget& target, const std::vector<BoardView>& views,
                               const CameraSolution& cameras, Stamp origin) {
  std::vector<TimedPose> poses;
  for (const BoardView& view : views) {
    const double time = (view.stamp - origin).seconds();
    if (view.camera >= cameras.camera_count) continue;
    if (!poses.empty() && time - poses.back().time < 1e-3) continue;  // camera 0's pose has been taken
    const std::optional<SE3> T_cam_board =
        boardPose(target, cameras.camera[view.camera].model, view, kMostPoseRms);
    if (!T_cam_board) continue;
    const SE3 T_cam_cam0 = view.camera == 0 ? SE3() : cameras.T_cam1_cam0;
    poses.push_back({time, T_cam_board->inverse() * T_cam_cam0});
  }
  return poses;
}

std::vector<CameraTurn> turnsOf(const std::vector<TimedPose>& poses) {
  std::vector<CameraTurn> turns;
  for (std::size_t first = 0, last = 1; last < poses.size(); ++last) {
    const double seconds = poses[last].time - poses[first].time;
    if (seconds < kLeastTurnTime) continue;
    if (seconds < kLongestTurn) {
      const Eigen::Quaterniond turn =
          poses[first].T_board_cam0.rotation.conjugate() * poses[last].T_board_cam0.rotation;
      turns.push_back({poses[first].time, poses[last].time, first, last, logSo3(turn)});
    }
    first = last;
  }
  return turns;
}

/// s, median.
double spacingOf(const std::vector<TimedPose>& poses) {
  std::vector<double> spacings;
  for (std::size_t k = 1; k < poses.size(); ++k) spacings.push_back(poses[k].time - poses[k - 1].time);
  return medianOf(spacings);
}

SE3 poseAt(const std::vector<TimedPose>& poses, double time) {
  const auto next = std::lower_bound(poses.begin(), poses.end(), time,
                                     [](const TimedPose& p, double t) { return p.time < t; });
  if (next == poses.begin()) return poses.front().T_board_cam0;
  if (next == poses.end()) return poses.back().T_board_cam0;
  const TimedPose& before = *(next - 1);
  const double part = (time - before.time) / (next->time - before.time);
  return {before.T_board_cam0.rotation.slerp(part, next->T_board_cam0.rotation),
          (1 - part) * before.T_board_cam0.translation + part * next->T_board_cam0.translation};
}

void judgeFit(const MotionFit& fit, std::vector<std::string>& reasons) {
  if (fit.explained < kLeastExplained) {
    if (fit.turned_deg < kLeastTurn) {
      reasons.push_back(
          fmt::format("The rig hardly rotated: {:.2f} deg from image to image. Rotate it about all three "
                      "axes by 30 deg and more, once or twice a second.",
                      fit.turned_deg));
      return;
    }
    reasons.push_back(fmt::format(
        "At no time offset within {:g} s does the gyro follow the cameras: it explains {:.0f} % of their "
        "rotation. Stamps of images and samples must come from one clock, and both from the same rig.",
        kMaxShift, 100 * std::max(fit.explained, 0.0)));
    return;
  }
  if (fit.mirror_gain > 0.5 * kMirrorSigmas * kMirrorSigmas) {
    reasons.push_back(
        "The gyro's axes are left-handed: they match the camera's only mirrored. Two axes are swapped or one "
        "has the wrong sign; correct the driver's axes.");
  }
  if (fit.scale < 0.8 || fit.scale > 1.25) {
    reasons.push_back(
        fmt::format("The camera rotates {:.3g} times as fast as the gyro measures. Provide the gyro in "
                    "rad/s; degrees would give a factor of {:.3g}.",
                    fit.scale, 1 / kDegrees));
  }
}

}  // namespace

BatchStart startBatch(const CalibrationTarget& target, const std::vector<BoardView>& views,
                      const std::vector<ImuSample>& samples, const ImuNoise& noise,
                      const CameraSolution& cameras, double spacing) {
  BatchStart start;
  if (views.empty() || samples.empty()) {
    start.reasons.push_back(views.empty() ? "No image shows the board." : "The log has no IMU samples.");
    return start;
  }
  std::vector<BoardView> ordered = views;
  std::stable_sort(ordered.begin(), ordered.end(), [](const BoardView& a, const BoardView& b) {
    return a.stamp != b.stamp ? a.stamp < b.stamp : a.camera < b.camera;
  });
  start.origin = std::min(ordered.front().stamp, samples.front().stamp);
  const std::vector<TimedPose> poses = posesOf(target, ordered, cameras, start.origin);
  if (poses.size() < kFewestPoses) {
    start.reasons.push_back(fmt::format(
        "Only {} images show enough of the board, {} are required. Keep the board in view for half a minute.",
        poses.size(), kFewestPoses));
    return start;
  }
  if (const double spacing_of_images = spacingOf(poses); spacing_of_images >= kLongestTurn) {
    start.reasons.push_back(
        fmt::format("Images with the board are {:.0f} ms apart, too far to follow the rotation between them. "
                    "Record at 5 Hz or more, with the board in view.",
                    1e3 * spacing_of_images));
    return start;
  }
  const GyroIntegral gyro(samples, start.origin);
  const std::vector<CameraTurn> turns = turnsOf(poses);
  const std::optional<MotionFit> fit = MotionFitter(turns, gyro).fit(0);
  if (!fit) {
    start.reasons.push_back(
        "Images and IMU samples do not overlap in time. Both must be stamped by one clock.");
    return start;
  }
  start.fit = *fit;
  judgeFit(*fit, start.reasons);
  if (!start.reasons.empty()) return start;

  start.data.noise = noise;
  for (const ImuSample& sample : samples) {
    const bool clipped = sample.gyro.cwiseAbs().maxCoeff() >= noise.gyro_saturation ||
                         sample.accel.cwiseAbs().maxCoeff() >= noise.accel_saturation;
    if (clipped) continue;
    start.data.readings.push_back({(sample.stamp - start.origin).seconds(), sample.gyro, sample.accel});
  }
  for (const BoardView& view : ordered) {
    if (view.camera >= cameras.camera_count || view.corners.empty()) continue;
    SeenView seen{(view.stamp - start.origin).seconds(), view.camera, {}};
    for (const BoardCorner& corner : view.corners) {
      seen.corners.push_back({corner.id, target.corner(corner.id), corner.pixel, false});
    }
    // In the order of a rolling shutter's rows, so that corners of one segment are adjacent.
    std::stable_sort(seen.corners.begin(), seen.corners.end(),
                     [](const SeenCorner& a, const SeenCorner& b) { return a.pixel.y() < b.pixel.y(); });
    start.data.views.push_back(std::move(seen));
  }

  BatchState& state = start.state;
  state.camera_count = cameras.camera_count;
  state.shift = fit->shift;
  const SE3 T_body_cam0(Eigen::Matrix3d(fit->R_cam_imu.transpose()), Eigen::Vector3d::Zero());
  state.T_body_cam[0] = T_body_cam0;
  state.T_body_cam[1] = T_body_cam0 * cameras.T_cam1_cam0.inverse();
  for (std::size_t c = 0; c < cameras.camera_count; ++c) state.camera[c] = cameras.camera[c].model;

  // The spline covers the time seen by both sensors.
  const double begin = std::max(poses.front().time + fit->shift, start.data.readings.front().time);
  const double end = std::min(poses.back().time + fit->shift, start.data.readings.back().time);
  const auto segments = static_cast<std::size_t>(std::max((end - begin) / spacing, 1.0));
  std::vector<SE3> controls;
  for (std::size_t k = 0; k < segments + SplineTrajectory::kOrder - 1; ++k) {
    const double time = begin + spacing * (static_cast<double>(k) - SplineTrajectory::kCentreOffset);
    controls.push_back(poseAt(poses, time - fit->shift) * T_body_cam0.inverse());
  }
  state.spline = SplineTrajectory(begin, spacing, std::move(controls));
  const double follow =
      kBiasPart * std::min(noise.gyro_density / noise.gyro_walk, noise.accel_density / noise.accel_walk);
  state.bias_every = std::clamp(static_cast<int>(follow / spacing), 1, kMostBiasKnots);

  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const TimedReading& reading : start.data.readings) {
    if (reading.time < begin || reading.time > end) continue;
    up += state.spline.pose(reading.time).rotation * reading.accel;
  }
  state.gravity = -noise.gravity * up.normalized();
  return start;
}

}  // namespace swiftlet
