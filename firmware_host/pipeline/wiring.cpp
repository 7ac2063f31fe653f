// The system in one screen. Stages: pairing, track, smooth (the odometry's two halves). Arrows:
//
//   camera 0 --+                       newest state, for prediction
//              +-> pairing -> track <--------------------------+
//   camera 1 --+                |                              |
//                               +-> TrackedFrame -> smooth ----+-> OdometryOutput -> listener
//   IMU ------------------------------> addImu ----^
//                                        +-> NavState at IMU rate -> listener
//                                        keyframes, IMU -> full smoother -> map.tum (after the run)
//   track file --------------------> TrackedFrame (in place of cameras, pairing and track)

#include "firmware_host/pipeline/wiring.hpp"

#include <algorithm>
#include <limits>

namespace swiftlet {
namespace {

constexpr Stamp kEndOfTime{std::numeric_limits<std::int64_t>::max()};

PairingSettings pairingSettings(const Rig& rig, const Settings& settings) {
  PairingSettings result;
  result.cameras = settings.odometry.use_stereo ? rig.camera_count : 1;
  result.tolerance = Duration::fromSeconds(settings.pairing.tolerance_ms * 1e-3);
  result.patience = Duration::fromSeconds(settings.pairing.patience_ms * 1e-3);
  return result;
}

}  // namespace

Wiring::Wiring(const Rig& rig, const ImuNoise& noise, const Settings& settings, RunListener& listener)
    : rig_(rig),
      noise_(noise),
      odometry_settings_(settings.odometry),
      pairing_(pairingSettings(rig, settings)),
      odometry_(rig, noise, settings.odometry),
      effort_(settings.effort),
      listener_(listener) {}

// camera -> pairing -> track -> smooth
void Wiring::feedImage(const CameraFrame& frame) {
  ++statistics_.images;
  if (!statistics_.first_image) statistics_.first_image = frame.stamp;
  statistics_.last_image = frame.stamp;
  Status status;
  addTime(statistics_.times, StageId::kPairing, measured([&] { status = pairing_.push(frame, paired_); }));
  if (status.ok()) passFrame(paired_);
  if (status.code == StatusCode::kInvalidInput) {
    listener_.onRemark(frame.stamp, std::string("image refused: ") + status.what);
  }
}

// IMU -> addImu, or held back while a frame waits for its partner
void Wiring::feedImu(const ImuSample& sample) {
  if (pairing_.expire(sample.stamp, paired_).ok() || (held_imu_.full() && pairing_.flush(paired_).ok())) {
    passFrame(paired_);
  }
  if (pairing_.holdsImage() && sample.stamp > pairing_.waitingStamp()) {
    // A patience of 1 s at 1 kHz fits; beyond it the frame was let go just above.
    if (held_imu_.tryPushBack(sample)) return;
  }
  passImu(sample);
}

// track file -> smooth
void Wiring::feedTracks(const TrackedFrame& tracked) {
  if (!statistics_.first_image) statistics_.first_image = tracked.stamp;
  statistics_.last_image = tracked.stamp;
  ++statistics_.frames;
  passTracks(tracked, {});
}

void Wiring::passFrame(const StereoFrame& frame) {
  passHeldImu(frame.stamp);
  ++statistics_.frames;
  Status status;
  const Spent spent = measured([&] { status = odometry_.track(frame, effort_, tracked_); });
  addTime(statistics_.times, StageId::kTrack, spent, status.ok() && tracked_.keyframe);
  if (status.ok()) {
    passTracks(tracked_, spent);
  } else {
    noteFault(status, statistics_.frames_refused);
    listener_.onRemark(frame.stamp, std::string("frame refused: ") + status.what);
  }
  passHeldImu(pairing_.holdsImage() ? pairing_.waitingStamp() : kEndOfTime);
}

void Wiring::passTracks(const TrackedFrame& tracked, Spent spent) {
  Status status;
  const Spent smoothing = measured([&] { status = odometry_.smooth(tracked, effort_, output_); });
  addTime(statistics_.times, StageId::kSmooth, smoothing, tracked.keyframe);
  spent += smoothing;
  addTime(statistics_.times, StageId::kFrameTotal, spent, tracked.keyframe);
  if (!status.ok() && status.code != StatusCode::kNotReady) noteFault(status, statistics_.smooth_faults);
  if (tracked.keyframe) ++statistics_.keyframes;
  noteOutput(tracked.stamp, output_);
  if (full_smoother_ && tracked.keyframe && output_.has_state) {
    Status kept;
    addTime(statistics_.times, StageId::kMap,
            measured([&] { kept = full_smoother_->addKeyframe(tracked, output_.state); }));
    if (!kept.ok()) ++statistics_.faults[kept.what];
  }
  listener_.onFrame(tracked, output_);
}

// keyframes with their causal states, and the IMU between them -> full smoother
void Wiring::keepForMap() {
  Rig rig = rig_;
  if (!odometry_settings_.use_stereo) rig.camera_count = std::min<std::size_t>(rig.camera_count, 1);
  ImuNoise noise = noise_;
  noise.gyro_density *= odometry_settings_.gyro_inflation;
  noise.accel_density *= odometry_settings_.accel_inflation;
  FullSmootherSettings settings;
  settings.pixel_sigma = odometry_settings_.pixel_sigma;
  full_smoother_ = std::make_unique<FullSmoother>(rig, noise, settings);
}

std::vector<Wiring::MapPose> Wiring::solveMap() {
  std::vector<MapPose> poses;
  if (!full_smoother_) return poses;
  FullSmootherReport report;
  Status status;
  addTime(statistics_.times, StageId::kMap, measured([&] { status = full_smoother_->solve(report); }));
  if (!status.ok()) {
    ++statistics_.faults[status.what];
    return poses;
  }
  statistics_.map = report;
  for (std::size_t k = 0; k < full_smoother_->size(); ++k) {
    const NavState state = full_smoother_->state(k);
    poses.push_back({state.stamp, state.T_world_body});
  }
  return poses;
}

void Wiring::passImu(const ImuSample& sample) {
  NavState propagated;
  Status status;
  const Spent spent =
      measured([&] { status = odometry_.addImu(sample, want_imu_states_ ? &propagated : nullptr); });
  addTime(statistics_.times, StageId::kImu, spent);
  ++statistics_.imu_samples;
  const bool taken = status.ok() || status.code == StatusCode::kNotReady;
  if (full_smoother_ && taken) full_smoother_->addImu(sample);
  if (status.ok()) {
    if (want_imu_states_) listener_.onImuState(propagated);
  } else if (status.code != StatusCode::kNotReady) {
    noteFault(status, statistics_.imu_refused);
  }
}

void Wiring::passHeldImu(Stamp until) {
  std::size_t passed = 0;
  while (passed < held_imu_.size() && held_imu_[passed].stamp <= until) passImu(held_imu_[passed++]);
  for (std::size_t i = passed; i < held_imu_.size(); ++i) held_imu_[i - passed] = held_imu_[i];
  held_imu_.resize(held_imu_.size() - passed);
}

void Wiring::finish() {
  if (pairing_.flush(paired_).ok()) passFrame(paired_);
  passHeldImu(kEndOfTime);
  output_ = OdometryOutput{};
  odometry_.finish(output_);
  for (const Event& event : output_.events) {
    EventTotal& total = statistics_.events[event.kind];
    ++total.count;
    total.value += event.value;
  }
  statistics_.pairing = pairing_.counters();
  listener_.onFinish(output_);
}

void Wiring::noteOutput(Stamp stamp, const OdometryOutput& output) {
  for (const Event& event : output.events) {
    EventTotal& total = statistics_.events[event.kind];
    ++total.count;
    total.value += event.value;
  }
  if (output.has_state) {
    if (!statistics_.first_pose) statistics_.first_pose = stamp;
    ++statistics_.poses;
  } else if (*output.waiting_for != '\0' && std::string_view(waiting_for_) != output.waiting_for) {
    waiting_for_ = output.waiting_for;
    listener_.onRemark(stamp, std::string("no pose yet, waiting for ") + waiting_for_);
  }
  if (statistics_.first_pose) ++statistics_.frames_since_first_pose;
  const HealthChange now{stamp, output.state.health, output.state.epoch};
  if (statistics_.health.empty() || statistics_.health.back().health != now.health ||
      statistics_.health.back().epoch != now.epoch) {
    statistics_.health.push_back(now);
  }
}

void Wiring::noteFault(const Status& status, std::uint64_t& counter) {
  ++counter;
  ++statistics_.faults[status.what];
}

}  // namespace swiftlet
