#include "firmware_host/graph/frame_queue.hpp"

#include <algorithm>

#include "firmware_host/graph/sensor_node.hpp"

namespace swiftlet {
FrameQueue::FrameQueue(Node& track, const GraphContext& context, const SensorNode& sensors)
    : images{ImageIn(track, "camera_0_dropped", Arrow::kWakes),
             ImageIn(track, "camera_1_dropped", Arrow::kWakes)},
      sensors_(sensors),
      cameras_(context.rig.camera_count),
      sample_patience_(context.options.sample_patience),
      last_sample_(context.rig.sampleLead() -
                   Duration::fromSeconds(context.noise.rate_hz > 0 ? 1 / context.noise.rate_hz : 0)),
      pairing_(context.settings.pairing.of(context.rig.camera_count)) {}

Stamp FrameQueue::newestSample() const { return sensors_.newestSample(); }

std::optional<FrameQueue::Refusal> FrameQueue::takeArrivals(Stamp newest_sample) {
  for (;;) {
    bool any = false;
    for (std::size_t c = 0; c < cameras_; ++c) any = takeHead(c) || any;
    if (!any) break;
    // Of two cameras' images the earlier one goes first, independent of thread timing.
    std::size_t first = held_[0].has_head ? 0 : 1;
    if (held_[0].has_head && held_[1].has_head && held_[1].head().stamp < held_[0].head().stamp) first = 1;
    Held& held = held_[first];
    held.has_head = false;
    const Status status = pair(held.head());
    if (status.ok()) push(paired_);
    if (status.code == StatusCode::kInvalidInput) {
      const Refusal refusal{status, held.head().stamp};
      held.image[--held.count].reset();
      return refusal;
    }
  }
  // Before the first sample, a frame's lateness is unknown.
  const bool any_sample = newest_sample.ns != std::numeric_limits<std::int64_t>::min();
  while (any_sample && !waiting_.full() && pairing_.expire(newest_sample, paired_).ok()) push(paired_);
  return std::nullopt;
}

bool FrameQueue::takeHead(std::size_t camera) {
  Held& held = held_[camera];
  if (held.has_head) return true;
  if (held.count == held.image.size() || !images[camera].tryPop(held.image[held.count])) return false;
  ++held.count;
  held.has_head = true;
  return true;
}

Status FrameQueue::pair(const CameraFrame& image) {
  // The image was queued while the other camera's first image of the new time line was arriving.
  if (image.timeline < timeline_)
    return {StatusCode::kInvalidInput, "image from before the clock was restarted"};
  if (image.timeline > timeline_) {
    timeline_ = image.timeline;
    pairing_.restart();
  }
  return pairing_.push(image, paired_);
}

void FrameQueue::push(const StereoFrame& frame) {
  if (waiting_.full()) drop();
  static_cast<void>(waiting_.tryPushBack(frame));
}

void FrameQueue::release(const StereoFrame& frame) {
  for (std::size_t c = 0; c < cameras_; ++c) {
    Held& held = held_[c];
    std::size_t done = 0;
    while (done < held.count && held.image[done]->frame.number <= frame.number[c]) ++done;
    for (std::size_t i = 0; i < done; ++i) held.image[i].reset();
    for (std::size_t i = done; i < held.count; ++i) held.image[i - done] = std::move(held.image[i]);
    held.count -= done;
  }
}

void FrameQueue::pop() {
  if (told_) return told_.reset();
  release(waiting_.front());
  waiting_.erase(0);
  excused_ = std::max(excused_ - 1, 0);
}

void FrameQueue::drop() {
  pop();
  ++counters_.dropped;
}

bool FrameQueue::flush() {
  if (!pairing_.flush(paired_).ok()) return false;
  push(paired_);
  return true;
}

HostTimes FrameQueue::hostTimes() const {
  HostTimes times;
  if (told_) {
    times.arrival = times.exposure = wallSeconds();
    return times;
  }
  const StereoFrame& frame = waiting_.front();
  for (std::size_t c = 0; c < cameras_; ++c) {
    for (std::size_t i = 0; i < held_[c].count; ++i) {
      const ImageSlot& slot = *held_[c].image[i];
      if (slot.frame.number != frame.number[c] || slot.host.arrival < times.arrival) continue;
      times = slot.host;
    }
  }
  return times;
}

bool FrameQueue::awaitsSamples() {
  if (sample_patience_.ns == 0 || told_) return false;
  constexpr std::int64_t kNoWait = std::numeric_limits<std::int64_t>::max();
  // awaited_imu_ is written before the newest sample is read; the IMU's thread does the reverse. So at least
  // one of the two threads sees the other's write.
  const bool waited = awaited_imu_.exchange((waiting_.front().stamp + last_sample_).ns + 1) != kNoWait;
  bool waits = newestSample().ns < awaited_imu_.load();
  if (waits && wallSeconds() - hostTimes().arrival > sample_patience_.seconds()) {
    ++counters_.without_samples;
    waits = false;
  }
  if (waits) return true;
  awaited_imu_.store(kNoWait);
  if (waited) {
    wait_ended_ = wallSeconds();
    excused_ = size();
  }
  return false;
}

double FrameQueue::readySince() const { return std::max(hostTimes().arrival, wait_ended_); }

int FrameQueue::backlog() const { return size() - std::max(excused_, 1); }

bool FrameQueue::awaitedSampleCame() const { return newestSample().ns >= awaited_imu_.load(); }

}  // namespace swiftlet
