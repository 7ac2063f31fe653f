#include "estimator/odometry/smooth_stage.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace swiftlet {
namespace {

// The frames of the first second determine tilt, velocity and biases, so they get more iterations.
constexpr double kStartTime = 1.0;    // s
constexpr double kStampSlack = 1e-3;  // s, rounding of the stamps of periodic frames
constexpr int kStartIterations = 8;
// [s] of good health before the gyro's matrix is estimated: after a wrong start its errors would be
// attributed to the gyro.
constexpr double kTrustedTime = 2.0;  // s
// Possible motion and biases of a body at its first image, per axis.
constexpr double kStartVelocitySigma = 2.0;    // m/s
constexpr double kStartGyroBiasSigma = 0.1;    // rad/s
constexpr double kStartAccelBiasSigma = 0.15;  // m/s^2
// For this long after a rest the accelerometer gives the speed to a few cm/s.
constexpr double kRestRemembered = 2;  // s
constexpr double kCarriedBias = 2.0;   // factor on the last sigma: marginal covariances are optimistic

SmootherSettings smootherSettings(const OdometrySettings& settings) {
  SmootherSettings s;
  s.pixel_sigma = settings.pixel_sigma;
  s.horizon = settings.horizon;
  s.estimate_time_offset = settings.estimate_time_offset;
  s.estimate_extrinsics = settings.estimate_extrinsics;
  s.estimate_gyro = settings.estimate_gyro;
  return s;
}

}  // namespace

SmoothStage::SmoothStage(const Rig& rig, const ImuNoise& noise, const OdometrySettings& settings)
    : rig_(rigInUse(rig, settings)),
      noise_(inflatedNoise(noise, settings)),
      settings_(settings),
      smoother_(rig_, noise_, smootherSettings(settings)),
      ties_(settings.plane_point_sigma),
      monitor_(noise_),
      rest_(noise_),
      stillness_(rig_),
      scale_(noise_),
      health_(settings_, rig_.camera_count),
      mono_starter_(rig_, noise_),
      imu_(kImuHistory),
      calibration_(smoother_.calibration()) {}

void SmoothStage::addImu(const ImuSample& sample) {
  const SampleVerdict verdict = monitor_.check(sample);
  if (!verdict.status.ok()) {
    events_.raise(sample.stamp, EventKind::kImuInvalid, 1);
    return;
  }
  if (verdict.gap) {
    imu_gap_ = true;
    gap_end_ = sample.stamp;
    events_.raise(sample.stamp, EventKind::kImuGap, verdict.silence);
  }
  if (verdict.saturated) events_.raise(sample.stamp, EventKind::kImuSaturated, 1);
  if (verdict.learned) {
    noise_ = monitor_.noise();
    smoother_.setNoise(noise_);
    mono_starter_.setNoise(noise_);
  }
  imu_.push(sample);
  smoother_.addImu(sample);
  rest_.addImu(sample);
}

Status SmoothStage::step(const TrackedFrame& tracked, const Effort& effort, OdometryOutput& output) {
  trim();  // if the caller omitted it
  output.has_state = false;
  output.waiting_for = "";
  if (tracked.timeline != timeline_) {
    deliver(output);
    output.waiting_for = "frame from before the clock was restarted: dropped";
    return {StatusCode::kInvalidInput, output.waiting_for};
  }
  last_stamp_ = tracked.stamp;
  if (tracked.refused_before > 0) {
    events_.raise(tracked.refused_stamp, EventKind::kFrameDropped, tracked.refused_before);
  }
  rest_.addFrame(tracked.stamp + smoother_.timeOffset(), stillness_.update(tracked));
  const bool imu_gap = imu_gap_ || isSilent(imu_, noise_, tracked.stamp + smoother_.timeOffset());
  double blind = health_.secondsWithoutImage(tracked.stamp);
  const bool sees = static_cast<int>(tracked.features.size()) >= HealthMonitor::kMinSightings;
  lost_ = smoother_.started() && (lost_ || (imu_gap && blind > health_.goodAge()));
  if (lost_ && sees) {
    watch_.watchBlackout(tracked.stamp, blind, events_);
    leave(newestAsStart());
    blind = 0;
  }
  if (health_.lost()) giveUp();
  // A start must not span missing samples: it begins again with this frame.
  if (imu_gap) mono_starter_.reset();
  if (!smoother_.started() && !start(tracked, output)) {
    imu_gap_ = false;
    deliver(output);
    return okStatus();
  }
  if (mono_starter_.size() > 0) {
    const Status caught_up = catchUp();
    if (!caught_up.ok()) return fail(caught_up, output);
  }
  ties_.apply(smoother_, tracked, epoch_);
  Smoother::StepInput input;
  input.frame = &tracked;
  input.imu_gap = imu_gap;
  input.rest = rest_.state().number;
  if (!epoch_began_) epoch_began_ = tracked.stamp;
  input.estimate_gyro = health_.health() == Health::kGood && health_.secondsGood() > kTrustedTime;
  input.iterations =
      starting(tracked.stamp) ? std::max(kStartIterations, effort.iterations) : effort.iterations;
  input.max_features = effort.features;
  input.max_keyframes = effort.keyframes;
  imu_gap_ = false;
  Status status = smoother_.step(input);
  if (status.ok()) {
    trim_due_ = true;
    const FrameStatistics& figures = smoother_.statistics();
    // Enough known landmarks found again tie the image to the past; new landmarks do not count yet.
    const bool recognizes = figures.inliers_mono + figures.inliers_stereo >= HealthMonitor::kNominalSightings;
    if (blind > HealthMonitor::kLongCoast && sees && !recognizes) {
      watch_.watchBlackout(tracked.stamp, blind, events_);
      status = restartFromCoast(input);
    }
  }
  if (!status.ok()) return fail(status, output);
  publish(tracked, input.imu_gap, output);
  return okStatus();
}

void SmoothStage::trim() {
  if (!trim_due_) return;
  trim_due_ = false;
  smoother_.trim(left_step_);
  if (rig_.camera_count == 1) scale_.update(smoother_);
  ties_.review(smoother_);
  handOver();
}

void SmoothStage::take(const PlaneReport& report) {
  if (settings_.regularity_enabled) ties_.take(report);
}

void SmoothStage::finish(OdometryOutput& output) {
  trim();
  output.has_state = false;
  smoother_.flush(left_step_);
  handOver();
  deliver(output);
}

void SmoothStage::reset() {
  endEpoch();
  // They belong to the previous world.
  last_good_.reset();
  last_useful_.reset();
}

void SmoothStage::endEpoch() {
  trim();
  if (smoother_.started()) {
    smoother_.flush(left_step_);
    handOver();
  }
  ++epoch_;
  lost_ = false;
  left_at_.reset();
  events_.raise(last_stamp_, EventKind::kReset, epoch_);
  smoother_.reset();
  ties_.reset();
  health_.reset();
  scale_.reset();
  rest_.forgetEstimate();
  watch_.reset();
  mono_starter_.reset();
  epoch_began_.reset();
  last_rest_.reset();
  fix_ = StateFix{};
  fix_.state.epoch = epoch_;
  fix_.timeline = timeline_;
}

void SmoothStage::restart(std::uint32_t timeline, Stamp first) {
  const double back = imu_.empty() ? 0 : (imu_.newest().stamp - first).seconds();
  watch_.watchBlackout(last_stamp_, 0, events_);
  timeline_ = timeline;
  last_stamp_ = first;
  // One event per sample would leave no room for others.
  events_.merge(EventKind::kImuInvalid);
  events_.raise(first, EventKind::kStampsWentBack, back);
  reset();
  monitor_.restart();
  rest_.reset();
  imu_.clear();
  smoother_.forgetImu();
  imu_gap_ = false;
  gap_end_ = Stamp{};
}

void SmoothStage::window(SmoothedWindow& out) const {
  out.epoch = epoch_;
  out.timeline = timeline_;
  out.started = fix_.has_state;
  out.newest = fix_.state;
  out.calibration = calibration_;
  out.planes = ties_.planes();
  if (fix_.has_state) {
    smoother_.window(out);
  } else {
    out.poses.clear();
    out.landmarks.clear();
  }
}

void SmoothStage::link(const SmoothedWindow& window, KeyframeLink& out) {
  out.linked = false;
  if (!window.started || window.poses.empty()) return;
  const std::size_t newest = window.poses.size() - 1;
  std::size_t before = newest;
  while (before > 0 && !window.poses[before - 1].keyframe) --before;
  if (before == 0) return;
  --before;
  out.previous = window.poses[before].frame_index;
  out.T_previous_this = window.poses[before].T_world_body.inverse() * window.poses[newest].T_world_body;
  out.linked = smoother_.relativeCovariance(before, newest, out.covariance);
  // The smoother's covariance is of the position in the axes of the previous keyframe.
  Eigen::Matrix<double, 6, 6> turn = Eigen::Matrix<double, 6, 6>::Identity();
  turn.bottomRightCorner<3, 3>() = out.T_previous_this.R().transpose();
  out.covariance = turn * out.covariance * turn.transpose();
}

/// Stores keyframes that left the window for the next output.
void SmoothStage::handOver() {
  for (KeyframeState keyframe : left_step_) {
    keyframe.state.epoch = epoch_;
    if (!left_.tryPushBack(keyframe)) events_.raise(last_stamp_, EventKind::kCapacityReached, 1);
  }
  left_step_.clear();
}

void SmoothStage::deliver(OdometryOutput& output) {
  output.left_window = left_;
  left_.clear();
  events_.flush(output);
}

/// Determines the first state of an epoch. False while it must wait; the output says for what.
bool SmoothStage::start(const TrackedFrame& tracked, OdometryOutput& output) {
  const Stamp stamp = tracked.stamp + smoother_.timeOffset();
  StartPrior prior;
  prior.bias_gyro_sigma = kStartGyroBiasSigma;
  prior.bias_accel_sigma = kStartAccelBiasSigma;
  if (left_at_ && left_at_->gyro_bias_sigma > 0) {
    prior.bias_gyro = left_at_->state.bias_gyro;
    prior.bias_accel = left_at_->state.bias_accel;
    prior.bias_gyro_sigma = std::min(prior.bias_gyro_sigma, kCarriedBias * left_at_->gyro_bias_sigma);
    prior.bias_accel_sigma = std::min(prior.bias_accel_sigma, kCarriedBias * left_at_->accel_bias_sigma);
  }
  TiltEstimate tilt;
  const Stamp history = std::max(stamp - Duration::fromSeconds(2.0), gap_end_);
  if (isSilent(imu_, noise_, stamp) ||
      !estimateTilt(imu_.around(history, stamp), stamp, noise_, prior, tilt).ok()) {
    output.waiting_for = "IMU samples before the first image";
    return false;
  }
  StartState start;
  start.velocity_sigma = kStartVelocitySigma;
  const bool at_rest = rest_.state().at_rest;
  if (rig_.camera_count == 1 && !at_rest) {
    mono_starter_.push(tracked);
    if (!mono_starter_.trySolve(imu_, gap_end_, prior, smoother_.calibration(), smoother_.pixelSigma(), start,
                                output.waiting_for))
      return false;
  } else {
    mono_starter_.reset();
    start.state.T_world_body.rotation = gravityAlignedRotation(tilt.up);
    start.tilt_sigma = tilt.sigma;
    start.state.bias_gyro = prior.bias_gyro;
    start.state.bias_accel = prior.bias_accel;
    start.gyro_bias_sigma = prior.bias_gyro_sigma;
    start.accel_bias_sigma = prior.bias_accel_sigma;
    if (at_rest) start.velocity_sigma = kRestVelocitySigma;
  }
  if (left_at_) goOnFrom(left_at_->state.T_world_body, start.state);
  smoother_.start(start);
  return true;
}

/// Ends the epoch; the next one continues from `at`.
void SmoothStage::leave(const StartState& at) {
  endEpoch();
  left_at_ = at;
}

/// Discards a lost state. The next epoch starts at its position and heading, or at the last good ones if the
/// health is failed.
void SmoothStage::giveUp() {
  StartState at = newestAsStart();
  const bool failed = health_.health() == Health::kFailed && last_good_;
  if (const auto& place = failed ? last_good_ : last_useful_) at.state.T_world_body = *place;
  at.gyro_bias_sigma = 0;  // do not carry biases over
  leave(at);
}

/// Rotates and moves a start to a position and heading; its tilt, and its velocity in body axes, stay.
void SmoothStage::goOnFrom(const SE3& place, BodyState& state) {
  const Eigen::Quaterniond start = state.T_world_body.rotation;
  const Eigen::Vector3d up = start.conjugate() * Eigen::Vector3d::UnitZ();
  state.T_world_body.rotation =
      Eigen::Quaterniond::FromTwoVectors(place.rotation * up, Eigen::Vector3d::UnitZ()) * place.rotation;
  state.T_world_body.translation = place.translation;
  state.v_world_body = state.T_world_body.rotation * (start.conjugate() * state.v_world_body);
}

/// The newest state with its marginal sigmas, the largest over the axes.
StartState SmoothStage::newestAsStart() const {
  const WindowState& newest = smoother_.newest();
  const Matrix15d& P = smoother_.covariance();
  const auto sigma = [&P](int first) { return std::sqrt(P.diagonal().segment<3>(first).maxCoeff()); };
  const Eigen::Vector3d up = newest.x.T_world_body.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  const Eigen::Matrix3d level = Eigen::Matrix3d::Identity() - up * up.transpose();
  StartState start;
  start.state = newest.x;
  start.tilt_sigma = std::sqrt((level * P.topLeftCorner<3, 3>() * level).trace());
  start.velocity_sigma = sigma(6);
  start.gyro_bias_sigma = sigma(9);
  start.accel_bias_sigma = sigma(12);
  return start;
}

/// Call after a step that ended a long coast. The state is the result of the IMU alone, with an error of
/// decimetres, and while it shares a window with earlier states every correction of tilt and bias would move
/// it again. It therefore becomes the first state of a new epoch, with the covariance of this step.
Status SmoothStage::restartFromCoast(const Smoother::StepInput& input) {
  const StartState start = newestAsStart();
  const bool keyframe = smoother_.newest().keyframe;
  endEpoch();
  if (keyframe && !left_.empty()) left_.popBack();  // the new epoch delivers it
  smoother_.start(start);
  epoch_began_ = input.frame->stamp;
  const Status status = smoother_.step(input);
  trim_due_ = status.ok();
  return status;
}

/// Processes the frames that waited for the start, all but the newest.
Status SmoothStage::catchUp() {
  Smoother::StepInput input;
  input.estimate_gyro = false;
  input.iterations = kStartIterations;
  for (std::size_t k = 0; k + 1 < mono_starter_.size(); ++k) {
    input.frame = &mono_starter_.frame(k);
    const Status status = smoother_.step(input);
    if (!status.ok()) return status;
    smoother_.trim(left_step_);
    if (rig_.camera_count == 1) scale_.update(smoother_);
    handOver();
  }
  mono_starter_.reset();
  return okStatus();
}

/// The window could not be solved. The next epoch continues from the last useful pose; nothing else is kept.
Status SmoothStage::fail(const Status& status, OdometryOutput& output) {
  if (last_useful_) {
    StartState at;
    at.state.T_world_body = *last_useful_;
    at.gyro_bias_sigma = 0;
    leave(at);
  } else {
    reset();
  }
  deliver(output);
  output.waiting_for = status.what;
  return status;
}

bool SmoothStage::starting(Stamp stamp) const {
  return !epoch_began_ || (stamp - *epoch_began_).seconds() < kStartTime - kStampSlack;
}

void SmoothStage::publish(const TrackedFrame& tracked, bool imu_missing, OdometryOutput& output) {
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
  output.statistics.scale = scale_.scale();
  output.statistics.scale_sigma = rig_.camera_count == 1 ? scale_.sigma() : 0;
  calibration_ = smoother_.calibration();
  output.calibration = calibration_;
  state.health = health_.update(
      {tracked, output.statistics, state, imu_missing, *epoch_began_ == tracked.stamp, scale_.confirmed()});
  output.doubt = health_.doubt();
  if (state.health == Health::kGood) last_good_ = state.T_world_body;
  if (health_.useful()) last_useful_ = state.T_world_body;
  smoother_.setHealth(state.health);
  watch_.step({tracked.stamp, tracked.camera_present, rig_.camera_count, rest_.state().at_rest, state.health,
               output.doubt, health_.secondsWithoutImage(tracked.stamp), health_.goodAge()},
              events_);
  fix_.has_state = true;
  fix_.state = state;
  fix_.gyro = calibration_.gyro;
  fix_.imu = output.statistics.noise.imu;
  fix_.good_age = health_.goodAge();
  fix_.last_accepted = health_.lastAccepted() + smoother_.timeOffset();
  if (!starting(tracked.stamp)) {
    if (rest_.state().at_rest) last_rest_ = tracked.stamp;
    // With one camera that has hardly moved, the initial guess of distances looks like a measurement, so the
    // speed's sigma cannot be trusted.
    const bool speed_known = rig_.camera_count > 1 || scale_.confirmed() ||
                             (last_rest_ && (tracked.stamp - *last_rest_).seconds() < kRestRemembered);
    const Matrix15d& P = state.covariance;
    rest_.setEstimate(state.bias_gyro, std::sqrt(P.diagonal().segment<3>(9).maxCoeff()),
                      state.v_world_body.norm(),
                      speed_known ? std::sqrt(P.diagonal().segment<3>(6).maxCoeff())
                                  : std::numeric_limits<double>::infinity());
  }
  state.stamp = tracked.stamp;
  output.has_state = true;
  deliver(output);
}

}  // namespace swiftlet
