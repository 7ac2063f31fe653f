#include "estimator/odometry/pairing.hpp"

#include <algorithm>

#include "estimator/odometry/stamp_guard.hpp"

namespace swiftlet {
namespace {

Duration absolute(Duration d) { return d.ns < 0 ? -d : d; }

std::size_t otherCamera(std::size_t camera) { return 1 - camera; }

}  // namespace

Status Pairing::refuse(std::size_t camera, const char* why) {
  if (camera < kMaxCameras) ++counters_.refused[camera];
  return {StatusCode::kInvalidInput, why};
}

Duration Pairing::toleranceFor(const CameraFrame& frame) const {
  if (!any_seen_[frame.camera]) return settings_.tolerance;
  const Duration quarter{(frame.stamp - last_seen_[frame.camera]).ns / 4};
  return std::min(settings_.tolerance, quarter);
}

Status Pairing::giveSingle(const CameraFrame& frame, StereoFrame& paired) {
  paired = StereoFrame{};
  paired.stamp = frame.stamp;
  paired.timeline = frame.timeline;
  paired.index = next_index_++;
  paired.image[frame.camera] = frame.image;
  paired.number[frame.camera] = frame.number;
  any_given_ = true;
  last_given_ = frame.stamp;
  if (settings_.cameras > 1) {
    ++counters_.unpaired[frame.camera];
    int& missing = missing_running_[otherCamera(frame.camera)];
    missing = std::min(missing + 1, kLostAfter);
  }
  return okStatus();
}

Status Pairing::givePair(const CameraFrame& a, const CameraFrame& b, StereoFrame& paired) {
  paired = StereoFrame{};
  paired.stamp = a.camera == 0 ? a.stamp : b.stamp;
  paired.timeline = b.timeline;
  paired.index = next_index_++;
  paired.image[a.camera] = a.image;
  paired.image[b.camera] = b.image;
  paired.number[a.camera] = a.number;
  paired.number[b.camera] = b.number;
  any_given_ = true;
  last_given_ = std::max(a.stamp, b.stamp);
  missing_running_ = {};
  ++counters_.pairs;
  return okStatus();
}

Status Pairing::waitOrGive(const CameraFrame& frame, StereoFrame& paired) {
  if (isLost(otherCamera(frame.camera))) return giveSingle(frame, paired);
  pending_ = frame;
  waiting_ = true;
  return {StatusCode::kNotReady, "waits for the other camera's frame"};
}

void Pairing::restart() {
  waiting_ = false;
  any_given_ = false;
  any_seen_ = {};
  missing_running_ = {};
}

/// Only images from when there was no IMU to go by can be so far ahead of it.
void Pairing::forgetAheadOf(const CameraFrame& frame) {
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    if (any_seen_[c] && isFarAhead(frame.stamp, last_seen_[c])) any_seen_[c] = false;
  }
  if (any_given_ && isFarAhead(frame.stamp, last_given_)) any_given_ = false;
  if (waiting_ && isFarAhead(frame.stamp, pending_.stamp)) {
    waiting_ = false;
    ++counters_.refused[pending_.camera];
  }
}

Status Pairing::push(const CameraFrame& frame, StereoFrame& paired) {
  const std::size_t camera = frame.camera;
  if (camera >= kMaxCameras) return {StatusCode::kInvalidInput, "camera number beyond kMaxCameras"};
  if (camera >= settings_.cameras) return {StatusCode::kNotReady, "this camera is not used"};
  if (frame.image.empty()) return refuse(camera, "frame without pixels");
  forgetAheadOf(frame);
  if (any_seen_[camera] && frame.stamp <= last_seen_[camera]) {
    return refuse(camera, "stamp repeated or reversed within one camera");
  }
  const Duration tolerance = toleranceFor(frame);
  any_seen_[camera] = true;
  last_seen_[camera] = frame.stamp;
  // Whatever happens to this frame, its camera is alive again.
  const bool came_back = isLost(camera);
  missing_running_[camera] = 0;

  if (settings_.cameras == 1) return giveSingle(frame, paired);
  // A late partner of what went out is as useless as a reversed stamp.
  if (any_given_ && frame.stamp <= last_given_ + (came_back ? settings_.tolerance : tolerance)) {
    return refuse(camera, "frame arrived after its pair was processed");
  }
  if (!waiting_) return waitOrGive(frame, paired);

  if (pending_.camera != frame.camera && absolute(frame.stamp - pending_.stamp) <= tolerance) {
    waiting_ = false;
    return givePair(pending_, frame, paired);
  }
  if (frame.stamp < pending_.stamp) return giveSingle(frame, paired);  // its partner cannot come any more
  const CameraFrame overdue = pending_;
  const Status given = giveSingle(overdue, paired);
  pending_ = frame;  // waits even when its partner counts as lost: one frame goes out a call
  return given;
}

Status Pairing::expire(Stamp now, StereoFrame& paired) {
  if (!waiting_) return {StatusCode::kNotReady, "no frame waits"};
  // While its partner counts as lost a frame need not wait for it.
  const bool alone = isLost(otherCamera(pending_.camera));
  if (now - pending_.stamp <= (alone ? Duration{0} : settings_.patience)) {
    return {StatusCode::kNotReady, "no frame is overdue"};
  }
  return flush(paired);
}

Status Pairing::flush(StereoFrame& paired) {
  if (!waiting_) return {StatusCode::kNotReady, "no frame waits"};
  waiting_ = false;
  return giveSingle(pending_, paired);
}

}  // namespace swiftlet
