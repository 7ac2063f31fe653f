#include "estimator/odometry/odometry.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/frontend/frontend.hpp"
#include "estimator/imu/initialization.hpp"
#include "estimator/imu/preintegration.hpp"
#include "estimator/imu/propagation.hpp"
#include "estimator/imu/rest_detector.hpp"
#include "estimator/imu/sample_monitor.hpp"
#include "estimator/messages/smoothed_window.hpp"
#include "estimator/odometry/event_watch.hpp"
#include "estimator/odometry/health_monitor.hpp"
#include "estimator/odometry/mono_starter.hpp"
#include "estimator/smoother/imu_buffer.hpp"
#include "estimator/smoother/smoother.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kImuHistory = 4096;  // samples before and between frames
// With this many sample periods missing before an image, holding the last reading is no measurement.
constexpr double kSilentPeriods = 5.0;
// The first frames decide tilt, velocity and biases: they get more iterations than the steady state.
constexpr std::uint64_t kStartFrames = 20;
constexpr int kStartIterations = 8;
// What a flying body may be doing at its first image, in each axis.
constexpr double kStartVelocitySigma = 2.0;    // m/s
constexpr double kStartGyroBiasSigma = 0.1;    // rad/s
constexpr double kStartAccelBiasSigma = 0.15;  // m/s^2
constexpr double kRestVelocitySigma = 0.01;    // m/s
constexpr float kMinGate = 6.0F;               // px
constexpr float kMaxGate = 40.0F;              // px
// Predicted pixel error of a landmark after one interval: attitude and position error over depth.
constexpr double kGateSigmas = 3.0;

}  // namespace

class Odometry::Impl {
 public:
  Impl(const Rig& rig, const ImuNoise& noise, const OdometrySettings& settings)
      : rig_(withCameras(rig, settings)),
        noise_(inflated(noise, settings)),
        settings_(settings),
        frontend_(rig_, FrontendSettings{}),
        smoother_(rig_, noise_, smootherSettings(settings)),
        monitor_(noise_),
        rest_(noise_),
        propagator_(noise_),
        mono_starter_(rig_, noise_),
        imu_(kImuHistory) {}

  Status addImu(const ImuSample& sample, NavState* propagated) {
    const SampleVerdict verdict = monitor_.check(sample);
    if (!verdict.status.ok()) {
      events_.raise(sample.stamp, EventKind::kImuInvalid, 1);
      return verdict.status;
    }
    if (verdict.gap) {
      imu_gap_ = true;
      events_.raise(sample.stamp, EventKind::kImuGap, verdict.silence);
    }
    if (verdict.saturated) events_.raise(sample.stamp, EventKind::kImuSaturated, 1);
    imu_.push(sample);
    smoother_.addImu(sample);
    rest_.addImu(sample);
    if (!propagator_.hasState()) return {StatusCode::kNotReady, "no state to propagate yet"};
    NavState state;
    const Status status = propagator_.step(sample, &state);
    if (propagated != nullptr) {
      *propagated = state;
      propagated->epoch = epoch_;
      propagated->health = health_.at(sample.stamp);
    }
    return status;
  }

  Status track(const StereoFrame& frame, const Effort& effort, TrackedFrame& tracked) {
    if (has_frame_ && frame.stamp <= last_stamp_) {
      events_.raise(frame.stamp, EventKind::kFrameDropped, 1);
      return {StatusCode::kInvalidInput, "the frame's stamp repeats or goes back: frame dropped"};
    }
    predict(frame.stamp);
    const Status status =
        frontend_.step(frame, prediction_, std::min(effort.features, settings_.max_features), tracked);
    if (status.ok()) {  // a refused frame leaves the tracks where they were
      last_stamp_ = frame.stamp;
      has_frame_ = true;
    }
    return status;
  }

  Status smooth(const TrackedFrame& tracked, const Effort& effort, OdometryOutput& output) {
    output.has_state = false;
    output.waiting_for = "";
    rest_.addFrame(tracked.stamp, static_cast<double>(tracked.median_motion));
    if (!smoother_.started() && !start(tracked, output)) {
      deliver(output);
      return okStatus();
    }
    if (mono_starter_.size() > 0) {
      const Status caught_up = catchUp();
      if (!caught_up.ok()) return fail(caught_up, output);
    }
    Smoother::StepInput input;
    input.frame = &tracked;
    input.imu_gap = imu_gap_ || silent(tracked.stamp + smoother_.timeOffset());
    input.at_rest = rest_.state().at_rest;
    input.iterations =
        frames_in_epoch_ < kStartFrames ? std::max(kStartIterations, effort.iterations) : effort.iterations;
    imu_gap_ = false;
    ++frames_in_epoch_;
    const Status status = smoother_.step(input, left_step_);
    if (!status.ok()) return fail(status, output);
    handOver(left_step_);
    publish(tracked, input.imu_gap, output);
    return okStatus();
  }

  void finish(OdometryOutput& output) {
    output.has_state = false;
    smoother_.flush(left_step_);
    handOver(left_step_);
    deliver(output);
  }

  void reset() {
    if (smoother_.started()) {
      smoother_.flush(left_step_);
      handOver(left_step_);
    }
    ++epoch_;
    events_.raise(last_stamp_, EventKind::kReset, epoch_);
    frontend_.reset();
    smoother_.reset();
    propagator_.reset();
    health_.reset();
    watch_.reset();
    mono_starter_.reset();
    window_.poses.clear();
    window_.landmarks.clear();
    frames_in_epoch_ = 0;
  }

 private:
  static Rig withCameras(Rig rig, const OdometrySettings& settings) {
    if (!settings.use_stereo) rig.camera_count = std::min<std::size_t>(rig.camera_count, 1);
    return rig;
  }
  static ImuNoise inflated(ImuNoise noise, const OdometrySettings& settings) {
    noise.gyro_density *= settings.gyro_inflation;
    noise.accel_density *= settings.accel_inflation;
    return noise;
  }
  static SmootherSettings smootherSettings(const OdometrySettings& settings) {
    SmootherSettings s;
    s.pixel_sigma = settings.pixel_sigma;
    s.horizon = settings.horizon;
    s.estimate_time_offset = settings.estimate_time_offset;
    s.estimate_extrinsics = settings.estimate_extrinsics;
    return s;
  }

  /// Keyframes that left, for the next output.
  void handOver(const FixedVector<KeyframeState, kMaxStates>& left) {
    for (KeyframeState keyframe : left) {
      keyframe.state.epoch = epoch_;
      if (!left_.tryPushBack(keyframe)) events_.raise(last_stamp_, EventKind::kCapacityReached, 1);
    }
  }
  void deliver(OdometryOutput& output) {
    output.left_window = left_;
    left_.clear();
    events_.flush(output);
  }

  /// No sample for many periods before `stamp`.
  [[nodiscard]] bool silent(Stamp stamp) const {
    return imu_.empty() || (stamp - imu_.newest().stamp).seconds() * noise_.rate_hz > kSilentPeriods;
  }

  /// Where things will be seen at `stamp`: the turn since the last frame, and the landmarks' pixels.
  void predict(Stamp stamp) {
    prediction_.has_rotation = false;
    prediction_.landmarks.clear();
    if (!has_frame_ || imu_.empty()) return;
    const Stamp from = last_stamp_ + smoother_.timeOffset();
    const Stamp to = stamp + smoother_.timeOffset();
    const Eigen::Vector3d bias = smoother_.started() ? smoother_.newest().x.bias_gyro : start_bias_gyro_;
    Preintegration turn(noise_, bias, Eigen::Vector3d::Zero());
    if (imu_gap_ || silent(to)) return;  // better no prediction than a turn that was not measured
    if (!turn.integrate(imu_.around(from, to), from, to).ok()) return;
    prediction_.has_rotation = true;
    prediction_.R_body_prev_body_cur = turn.deltaRotation();
    if (!smoother_.started() || !propagator_.hasState()) return;
    NavState state;
    if (!propagator_.predict(to, state).ok()) return;
    const Matrix15d& P = state.covariance;
    const double angle = std::sqrt(P.diagonal().segment<3>(0).sum());
    const Eigen::Matrix3d relative_position =
        P.block<3, 3>(3, 3) - window_.newest.covariance.block<3, 3>(3, 3);
    const double distance = std::sqrt(std::max(relative_position.trace(), 0.0));
    std::array<SE3, kMaxCameras> T_cam_world;
    for (std::size_t c = 0; c < rig_.camera_count; ++c) {
      T_cam_world[c] = (state.T_world_body * smoother_.extrinsics()[c]).inverse();
    }
    for (const WindowLandmark& landmark : window_.landmarks) {
      PredictedLandmark predicted;
      predicted.id = landmark.id;
      double depth = 1e9;
      for (std::size_t c = 0; c < rig_.camera_count; ++c) {
        const Eigen::Vector3d p = T_cam_world[c] * landmark.p_world;
        Eigen::Vector2d pixel;
        if (!rig_.camera[c].project(p, pixel) || !rig_.camera[c].inImage(pixel)) continue;
        predicted.visible[c] = true;
        predicted.pixel[c] = pixel.cast<float>();
        depth = std::min(depth, p.norm());
      }
      if (!predicted.visible[0] && !predicted.visible[1]) continue;
      const double gate = kGateSigmas * rig_.camera[0].focal() * (angle + distance / depth);
      predicted.gate = std::clamp(static_cast<float>(gate), kMinGate, kMaxGate);
      static_cast<void>(prediction_.landmarks.tryPushBack(predicted));
    }
  }

  /// The first state of an epoch. False while it must wait; the output says for what.
  bool start(const TrackedFrame& tracked, OdometryOutput& output) {
    const Stamp stamp = tracked.stamp + smoother_.timeOffset();
    StartPrior prior;
    prior.bias_gyro_sigma = kStartGyroBiasSigma;
    prior.bias_accel_sigma = kStartAccelBiasSigma;
    TiltEstimate tilt;
    const Stamp history = stamp - Duration::fromSeconds(2.0);
    if (imu_.empty() || !estimateTilt(imu_.around(history, stamp), stamp, noise_, prior, tilt).ok()) {
      output.waiting_for = "IMU samples before the first image";
      return false;
    }
    StartState start;
    start.velocity_sigma = kStartVelocitySigma;
    if (rig_.camera_count == 1 && !rest_.state().at_rest) {
      mono_starter_.push(tracked);
      if (!mono_starter_.trySolve(imu_, prior, settings_.pixel_sigma, start, output.waiting_for))
        return false;
    } else {
      mono_starter_.reset();
      start.stamp = stamp;
      start.state.T_world_body.rotation = gravityAlignedRotation(tilt.up);
      start.tilt_sigma = tilt.sigma;
      start.gyro_bias_sigma = kStartGyroBiasSigma;
      start.accel_bias_sigma = kStartAccelBiasSigma;
      if (rest_.state().at_rest) start.velocity_sigma = kRestVelocitySigma;
    }
    smoother_.start(start);
    frames_in_epoch_ = 0;
    return true;
  }

  /// Gives the smoother the frames that waited for the start, all but the newest.
  Status catchUp() {
    Smoother::StepInput input;
    input.iterations = kStartIterations;
    for (std::size_t k = 0; k + 1 < mono_starter_.size(); ++k) {
      input.frame = &mono_starter_.frame(k);
      const Status status = smoother_.step(input, left_step_);
      if (!status.ok()) return status;
      handOver(left_step_);
    }
    mono_starter_.reset();
    return okStatus();
  }

  Status fail(const Status& status, OdometryOutput& output) {
    reset();
    deliver(output);
    output.waiting_for = status.what;
    return status;
  }

  void publish(const TrackedFrame& tracked, bool imu_missing, OdometryOutput& output) {
    const WindowState& newest = smoother_.newest();
    NavState& state = output.state;
    state.stamp = newest.stamp;
    state.epoch = epoch_;
    state.T_world_body = newest.x.T_world_body;
    state.v_world_body = newest.x.v_world_body;
    state.bias_gyro = newest.x.bias_gyro;
    state.bias_accel = newest.x.bias_accel;
    state.covariance = smoother_.covariance();
    output.statistics = smoother_.statistics();
    output.calibration = {smoother_.timeOffset(), smoother_.extrinsics()};
    state.health =
        health_.update(tracked, output.statistics, rig_.camera_count, imu_missing, frames_in_epoch_);
    smoother_.setHealth(state.health);
    watch_.step({tracked.stamp, tracked.camera_present, rig_.camera_count, rest_.state().at_rest,
                 state.health, health_.secondsWithoutImage(tracked.stamp)},
                events_);
    smoother_.window(window_);
    window_.newest = state;
    window_.epoch = epoch_;
    static_cast<void>(propagator_.setState(state));
    if (frames_in_epoch_ > kStartFrames) {
      const Matrix15d& P = state.covariance;
      rest_.setEstimate(state.bias_gyro, std::sqrt(P.diagonal().segment<3>(9).maxCoeff()),
                        state.v_world_body.norm(), std::sqrt(P.diagonal().segment<3>(6).maxCoeff()));
    }
    state.stamp = tracked.stamp;
    output.has_state = true;
    deliver(output);
  }

  Rig rig_;
  ImuNoise noise_;
  OdometrySettings settings_;
  Frontend frontend_;
  Smoother smoother_;
  SampleMonitor monitor_;
  RestDetector rest_;
  Propagator propagator_;
  HealthMonitor health_;
  MonoStarter mono_starter_;
  ImuBuffer imu_;

  FrontendPrediction prediction_;
  SmoothedWindow window_;
  EventBuffer events_;
  EventWatch watch_;
  FixedVector<KeyframeState, kMaxStates> left_;       // to be delivered
  FixedVector<KeyframeState, kMaxStates> left_step_;  // by one step
  std::uint32_t epoch_ = 0;
  bool has_frame_ = false;
  Stamp last_stamp_;
  bool imu_gap_ = false;
  std::uint64_t frames_in_epoch_ = 0;
  Eigen::Vector3d start_bias_gyro_ = Eigen::Vector3d::Zero();
};

Odometry::Odometry(const Rig& rig, const ImuNoise& noise, const OdometrySettings& settings)
    : impl_(std::make_unique<Impl>(rig, noise, settings)) {}
Odometry::~Odometry() = default;
Status Odometry::addImu(const ImuSample& sample, NavState* propagated) {
  return impl_->addImu(sample, propagated);
}
Status Odometry::track(const StereoFrame& frame, const Effort& effort, TrackedFrame& tracked) {
  return impl_->track(frame, effort, tracked);
}
Status Odometry::smooth(const TrackedFrame& tracked, const Effort& effort, OdometryOutput& output) {
  return impl_->smooth(tracked, effort, output);
}
void Odometry::finish(OdometryOutput& output) { impl_->finish(output); }
void Odometry::reset() { impl_->reset(); }

}  // namespace swiftlet
