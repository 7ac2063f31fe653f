#include "estimator/odometry/pairing.hpp"

#include <algorithm>

#include "estimator/odometry/stamp_guard.hpp"

namespace swiftlet {
namespace {

Duration absolute(Duration d) { return d.ns < 0 ? -d : d; }

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

void Pairing::join(const CameraFrame& frame, Duration tolerance) {
  const std::size_t camera = frame.camera;
  Waiting* at = std::ranges::find_if(waiting_, [&](const Waiting& waiting) {
    return !waiting.frame.has(camera) && absolute(frame.stamp - waiting.newest) <= tolerance;
  });
  if (at == waiting_.end()) {
    const auto behind = std::ranges::find_if(
        waiting_, [&](const Waiting& waiting) { return waiting.frame.stamp > frame.stamp; });
    const auto index = static_cast<std::size_t>(behind - waiting_.begin());
    waiting_.insert(index, {});
    at = &waiting_[index];
    at->frame.stamp = at->newest = frame.stamp;
  }
  at->frame.image[camera] = frame.image;
  at->frame.number[camera] = frame.number;
  at->frame.timeline = frame.timeline;
  at->newest = std::max(at->newest, frame.stamp);
  if (camera == 0) at->frame.stamp = frame.stamp;
}

bool Pairing::ready(const Waiting& waiting) const {
  if (settings_.cameras == 1 || (waiting.frame.has(0) && waiting.frame.has(1))) return true;
  const std::size_t missing = waiting.frame.has(0) ? 1 : 0;
  const bool missed = any_seen_[missing] && last_seen_[missing] > waiting.newest;
  return missed || isLost(missing) || waiting_.size() > kPairingFrames ||
         now_ - waiting.newest > settings_.patience;
}

Status Pairing::give(StereoFrame& paired) {
  const Waiting given = waiting_.front();
  waiting_.erase(0);
  paired = given.frame;
  paired.index = next_index_++;
  any_given_ = true;
  last_given_ = given.newest;
  if (settings_.cameras == 1) return okStatus();
  if (paired.has(0) && paired.has(1)) {
    missing_running_ = {};
    ++counters_.pairs;
    return okStatus();
  }
  const std::size_t camera = paired.has(0) ? 0 : 1;
  ++counters_.unpaired[camera];
  int& missing = missing_running_[1 - camera];
  missing = std::min(missing + 1, kLostAfter);
  return okStatus();
}

Status Pairing::giveReady(StereoFrame& paired) {
  if (!waiting_.empty() && ready(waiting_.front())) return give(paired);
  return {StatusCode::kNotReady, "waits for the other camera's frame"};
}

void Pairing::restart() {
  waiting_.clear();
  any_given_ = false;
  any_seen_ = {};
  missing_running_ = {};
}

/// Forgets what is stamped far later than `frame`: such images can only be from before there was an IMU to
/// check them.
void Pairing::forgetAheadOf(const CameraFrame& frame) {
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    if (any_seen_[c] && isFarAhead(frame.stamp, last_seen_[c])) any_seen_[c] = false;
  }
  if (any_given_ && isFarAhead(frame.stamp, last_given_)) any_given_ = false;
  while (!waiting_.empty() && isFarAhead(frame.stamp, waiting_.back().frame.stamp)) {
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      if (waiting_.back().frame.has(c)) ++counters_.refused[c];
    }
    waiting_.popBack();
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
  // Even if this frame is refused, its camera is working again.
  const bool came_back = isLost(camera);
  missing_running_[camera] = 0;

  now_ = frame.stamp;
  // A partner that arrives after its pair was output is refused like a reversed stamp.
  if (settings_.cameras > 1 && any_given_ &&
      frame.stamp <= last_given_ + (came_back ? settings_.tolerance : tolerance)) {
    return refuse(camera, "frame arrived after its pair was processed");
  }
  join(frame, tolerance);
  return giveReady(paired);
}

Status Pairing::expire(Stamp now, StereoFrame& paired) {
  now_ = now;
  return giveReady(paired);
}

Status Pairing::flush(StereoFrame& paired) {
  if (waiting_.empty()) return {StatusCode::kNotReady, "no frame waits"};
  return give(paired);
}

}  // namespace swiftlet
