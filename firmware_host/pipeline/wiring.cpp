// The system in one screen. Stages: pairing, track, smooth (the odometry's two halves). Arrows:
//
//   camera 0 --+                       newest state, for prediction
//              +-> pairing -> track <--------------------------+
//   camera 1 --+                |                              |
//                               +-> TrackedFrame -> smooth ----+-> OdometryOutput -> listener
//   IMU ------------------------------> addImu ----^
//                                        +-> NavState at IMU rate -> listener
//   track file --------------------> TrackedFrame (in place of cameras, pairing and track)

#include "firmware_host/pipeline/wiring.hpp"

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
    : pairing_(pairingSettings(rig, settings)),
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
  listener_.onFrame(tracked, output_);
}

void Wiring::passImu(const ImuSample& sample) {
  NavState propagated;
  Status status;
  const Spent spent =
      measured([&] { status = odometry_.addImu(sample, want_imu_states_ ? &propagated : nullptr); });
  addTime(statistics_.times, StageId::kImu, spent);
  ++statistics_.imu_samples;
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
