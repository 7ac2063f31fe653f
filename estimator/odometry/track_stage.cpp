#include "estimator/odometry/track_stage.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "estimator/imu/preintegration.hpp"
#include "estimator/messages/camera_scan.hpp"
#include "estimator/odometry/stamp_guard.hpp"

namespace swiftlet {
namespace {

constexpr float kMinGate = 6.0F;   // px
constexpr float kMaxGate = 40.0F;  // px
// Predicted pixel error of a landmark after one interval: attitude and position error over depth.
constexpr double kGateSigmas = 3.0;

// The pixel at which camera c sees, in its own row, a point given in the camera at the middle row. False if
// the lens does not show it.
bool projectToRow(const Rig& rig, std::size_t c, const CameraScan& scan, const Eigen::Vector3d& p,
                  Eigen::Vector2d& pixel) {
  // Each round reduces the error to a hundredth, at 2 rad/s and 20 ms.
  constexpr int kRounds = 2;
  bool shown = rig.camera[c].project(p, pixel);
  for (int i = 0; shown && rig.rolls() && i < kRounds; ++i) {
    shown = rig.camera[c].project(scan.atRow(p, rig.rowTime(c, pixel.y())), pixel);
  }
  return shown;
}

}  // namespace

TrackStage::TrackStage(const Rig& rig, const ImuNoise& noise, const OdometrySettings& settings)
    : rig_(rigInUse(rig, settings)),
      noise_(inflatedNoise(noise, settings)),
      max_features_(settings.max_features),
      frontend_(rig_, FrontendSettings{}),
      monitor_(noise_),
      propagator_(noise_),
      imu_(kImuHistory) {
  window_.calibration.camera_to_imu_shift = rig_.camera_to_imu_shift;
  window_.calibration.readout = rig_.readout;
  window_.calibration.T_body_cam = rig_.T_body_cam;
  if (settings.estimate_extrinsics) {
    window_.calibration.stereo_rotation_sigma = std::sqrt(2.0) * kExtrinsicRotationPriorSigma;
  }
}

void TrackStage::addImu(const ImuSample& sample) {
  const SampleVerdict verdict = monitor_.check(sample);
  if (!verdict.status.ok()) return;
  imu_gap_ = imu_gap_ || verdict.gap;
  if (verdict.learned) {
    noise_ = monitor_.noise();
    propagator_.setNoise(noise_);
  }
  imu_.push(sample);
  static_cast<void>(propagator_.step(sample));  // kept for later if there is no state yet
}

void TrackStage::restart(std::uint32_t timeline, Stamp /*first*/) {
  timeline_ = timeline;
  monitor_.restart();
  propagator_.reset();
  imu_.clear();
  imu_gap_ = false;
  window_.started = false;
  restarted_ = true;
  forgetTracks();
}

void TrackStage::forgetTracks() {
  frontend_.reset();
  has_frame_ = false;
}

void TrackStage::take(const SmoothedWindow& window) {
  if (window.timeline != timeline_) return;
  // The new epoch of a new time line already has these tracks.
  if (window.epoch != window_.epoch && !restarted_) {
    frontend_.reset();
    propagator_.forgetState();
  }
  restarted_ = false;
  window_ = window;
  rig_.readout = window.calibration.readout;
  if (window_.started) static_cast<void>(propagator_.setState(window_.newest, window_.calibration.gyro));
}

Status TrackStage::step(const StereoFrame& frame, const Effort& effort, TrackedFrame& tracked) {
  const Status status = process(frame, effort, tracked);
  if (!status.ok()) {  // the tracks are unchanged
    ++refused_;
    refused_stamp_ = frame.stamp;
    return status;
  }
  last_stamp_ = frame.stamp;
  has_frame_ = true;
  imu_gap_ = false;
  tracked.refused_before = refused_;
  tracked.refused_stamp = refused_stamp_;
  refused_ = 0;
  return status;
}

Status TrackStage::process(const StereoFrame& frame, const Effort& effort, TrackedFrame& tracked) {
  if (frame.timeline != timeline_)
    return {StatusCode::kInvalidInput, "frame from before the clock was restarted: dropped"};
  // Not a late frame: earlier ones, from before there was an IMU to check them, were stamped far ahead.
  if (has_frame_ && isFarAhead(frame.stamp, last_stamp_)) forgetTracks();
  if (has_frame_ && frame.stamp <= last_stamp_) {
    return {StatusCode::kInvalidInput, "the frame's stamp repeats or goes backwards: frame dropped"};
  }
  predict(frame.stamp);
  tracked.timeline = timeline_;
  return frontend_.step(frame, prediction_, std::min(effort.features, max_features_), tracked);
}

void TrackStage::predict(Stamp stamp) {
  prediction_.has_rotation = false;
  prediction_.scan = {};
  prediction_.landmarks.clear();
  prediction_.T_body_cam = window_.calibration.T_body_cam;
  prediction_.stereo_rotation_sigma = window_.calibration.stereo_rotation_sigma;
  prediction_.has_extrinsics = prediction_.stereo_rotation_sigma > 0;
  if (!has_frame_ || imu_.empty()) return;
  const Duration shift = window_.calibration.camera_to_imu_shift;
  const Stamp from = last_stamp_ + shift;
  const Stamp to = stamp + shift;
  if (imu_gap_ || isSilent(imu_, noise_, to))
    return;  // no prediction is better than one from a rotation that was not measured
  const Eigen::Vector3d bias = window_.started ? window_.newest.bias_gyro : Eigen::Vector3d::Zero();
  Preintegration turn(noise_, bias, Eigen::Vector3d::Zero(), window_.calibration.gyro);
  if (!turn.integrate(imu_.around(from, to), from, to).ok()) return;
  prediction_.has_rotation = true;
  prediction_.R_body_prev_body_cur = turn.deltaRotation();
  prediction_.scan = imu_.scanTurnAt(to, rig_.readout, bias, window_.calibration.gyro);
  if (window_.started && propagator_.hasState()) predictLandmarks(to);
}

void TrackStage::predictLandmarks(Stamp stamp) {
  NavState state;
  if (!propagator_.predict(stamp, state).ok()) return;
  const Matrix15d& P = state.covariance;
  const double angle = std::sqrt(P.diagonal().segment<3>(0).sum());
  const Eigen::Matrix3d relative_position = P.block<3, 3>(3, 3) - window_.newest.covariance.block<3, 3>(3, 3);
  const double distance = std::sqrt(std::max(relative_position.trace(), 0.0));
  std::array<SE3, kMaxCameras> T_cam_world;
  const ScanMotion motion{prediction_.scan, state.T_world_body.rotation.conjugate() * state.v_world_body};
  std::array<std::optional<CameraScan>, kMaxCameras> scan;
  for (std::size_t c = 0; c < rig_.camera_count; ++c) {
    T_cam_world[c] = (state.T_world_body * window_.calibration.T_body_cam[c]).inverse();
    scan[c].emplace(window_.calibration.T_body_cam[c], motion);
  }
  for (const WindowLandmark& landmark : window_.landmarks) {
    PredictedLandmark predicted;
    predicted.id = landmark.id;
    double depth = 1e9;
    for (std::size_t c = 0; c < rig_.camera_count; ++c) {
      const Eigen::Vector3d p = T_cam_world[c] * landmark.p_world;
      Eigen::Vector2d pixel;
      if (!projectToRow(rig_, c, *scan[c], p, pixel) || !rig_.camera[c].inImage(pixel)) continue;
      predicted.visible[c] = true;
      predicted.pixel[c] = pixel.cast<float>();
      depth = std::min(depth, p.norm());
    }
    if (!predicted.visible[0] && !predicted.visible[1]) continue;
    const double gate = kGateSigmas * rig_.camera[0].focal() * (angle + distance / depth);
    predicted.gate = std::clamp(static_cast<float>(gate), kMinGate, kMaxGate);
    prediction_.landmarks.pushBack(predicted);
  }
}

}  // namespace swiftlet
