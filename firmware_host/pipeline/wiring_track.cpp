// The thread `track`: images from slots through pairing to the front-end.

#include <limits>

#include "firmware_host/pipeline/packed_copy.hpp"
#include "firmware_host/pipeline/wiring.hpp"

namespace swiftlet {
namespace {

constexpr Stamp kEndOfTime{std::numeric_limits<std::int64_t>::max()};

}  // namespace

void Wiring::takeImage(const CameraFrame& image, const HostTimes& host) {
  if (image.image.empty()) return;
  const auto copy = [](const void* from, std::uint8_t* to) {
    packedCopy(*static_cast<const ImageView*>(from), to);
  };
  takeImage(image, host, {copy, &image.image});
}

// camera -> slot -> track, mesh, record
void Wiring::takeImage(const CameraFrame& image, const HostTimes& host, const PixelWriter& pixels) {
  if (image.camera >= rig_.camera_count) return;
  Camera& camera = camera_[image.camera];
  auto& counters = counters_.sensor;
  if (image.image.width != rig_.camera[image.camera].width() ||
      image.image.height != rig_.camera[image.camera].height()) {
    ++counters.images_wrong_size[image.camera];
    return;
  }
  const SlotHandle handle = camera.pool.tryAcquire();
  if (!handle.valid()) {
    ++counters.images_lost[image.camera];
    return;
  }
  ImageSlot& slot = camera.pool.fill(handle);
  slot.frame = image;
  slot.frame.number = ++counters.images[image.camera];
  slot.host = host;
  pixels.write(pixels.device, slot.pixels.data());
  slot.frame.image = {slot.pixels.data(), image.image.width, image.image.height, image.image.width};
  if (to_recorder_) {
    const bool handed = camera.pool.tryHand(handle, kRecordReads);
    if (!handed) {
      ++counters.images_unrecorded[image.camera];
    } else if (!to_recorder_->image[image.camera].tryPush(handle)) {
      camera.pool.takeBack(handle, kRecordReads);
      ++counters.images_unrecorded[image.camera];
    }
  }
  if (camera.pool.tryHand(handle, kTrackReads)) {
    SlotHandle dropped;
    if (camera.ring.push(handle, dropped)) {
      camera.pool.takeBack(dropped, kTrackReads);
      ++counters.images_dropped[image.camera];
    }
  } else {
    ++counters.images_dropped[image.camera];
  }
  if (mesh_ && image.camera == 0) handToMesh(handle);
  camera.pool.finish(handle);
  camera.sensed.note(image.stamp, host.arrival);
  camera.facts.write(camera.sensed);
}

// track file -> smooth
bool Wiring::takeTracks(const TrackedFrame& tracked) {
  TrackMessage* message = tracked_ring_.beginPush();
  if (message == nullptr) return false;
  message->kind = TrackMessage::Kind::kFrame;
  message->status = okStatus();
  message->step = TrackStep{};
  message->step.frame = tracked.index;
  message->step.stamp = tracked.stamp;
  message->tracked = tracked;
  message->spent = {};
  message->host.arrival = message->host.exposure = wallSeconds();
  message->dropped = 0;
  message->effort_level = 0;
  message->mapped = false;
  tracked_ring_.commitPush();
  return true;
}

// IMU, images, newest window -> pairing -> track -> tracked frames
bool Wiring::track() {
  const bool ended = input_ended_.load(std::memory_order_acquire);
  // Before the images: a sample that is seen now came before every image taken below.
  tracking_.newest_sample = Stamp{newest_imu_.load(std::memory_order_acquire)};
  takeArrivals();
  if (tracking_.waiting.empty()) {
    tracking_.samples +=
        takeSurplus(imu_to_track_, [this](const ImuSample& sample) { track_.addImu(sample); });
    return ended && endTracking();
  }
  if (tracked_ring_.size() >= kTrackedRing) return false;
  if (!ended && awaitsSamples()) return false;
  return trackFrame();
}

/// Whether samples up to the stamp of the first frame are still to come. A sample less than one period before
/// the frame is its last.
bool Wiring::awaitsSamples() {
  if (sample_patience_.ns == 0) return false;
  const StereoFrame& frame = tracking_.waiting.front();
  // Written before the newest sample is read, as the IMU's thread reads it after its write: one of the two
  // sees the other.
  awaited_imu_.store((frame.stamp - sample_period_).ns + 1);
  bool waits = newest_imu_.load() < awaited_imu_.load();
  if (waits && wallSeconds() - hostTimesOf(frame).arrival > sample_patience_.seconds()) {
    ++counters_.track.without_samples;
    waits = false;
  }
  if (!waits) awaited_imu_.store(kEndOfTime.ns);
  return waits;
}

void Wiring::takeArrivals() {
  addTime(times_, StageId::kPairing, measured([&] {
            for (;;) {
              bool any = false;
              for (std::size_t c = 0; c < rig_.camera_count; ++c) any = popHead(c) || any;
              if (!any) break;
              // Of two cameras' images the earlier goes first, however the threads ran.
              std::size_t first = camera_[0].has_head ? 0 : 1;
              if (camera_[0].has_head && camera_[1].has_head && headOf(1).stamp < headOf(0).stamp) first = 1;
              camera_[first].has_head = false;
              pair(headOf(first));
            }
            // Before the first sample nothing says how late it is.
            const bool any_sample = tracking_.newest_sample.ns != std::numeric_limits<std::int64_t>::min();
            if (any_sample && pairing_.expire(tracking_.newest_sample, tracking_.paired).ok()) {
              queueFrame(tracking_.paired);
            }
          }));
}

bool Wiring::popHead(std::size_t c) {
  Camera& camera = camera_[c];
  if (camera.has_head) return true;
  SlotHandle handle;
  if (camera.held_count == camera.held.size() || !camera.ring.tryPop(handle)) return false;
  camera.held[camera.held_count++] = camera.pool.borrow(handle, kTrackReads);
  camera.has_head = true;
  return true;
}

void Wiring::pair(const CameraFrame& frame) {
  const Status status = pairing_.push(frame, tracking_.paired);
  if (status.code == StatusCode::kInvalidInput) {
    TrackMessage* message = tracked_ring_.size() < kTrackedRing ? tracked_ring_.beginPush() : nullptr;
    if (message != nullptr) {
      message->kind = TrackMessage::Kind::kImageRefused;
      message->status = status;
      message->step = TrackStep{};
      message->step.stamp = frame.stamp;
      message->dropped = 0;
      tracked_ring_.commitPush();
    }
    Camera& camera = camera_[frame.camera];
    camera.held[--camera.held_count].reset();
    return;
  }
  if (status.ok()) queueFrame(tracking_.paired);
}

void Wiring::queueFrame(const StereoFrame& frame) {
  if (tracking_.waiting.full()) {
    release(tracking_.waiting.front());
    tracking_.waiting.erase(0);
    ++tracking_.dropped;
    ++counters_.track.dropped;
  }
  static_cast<void>(tracking_.waiting.tryPushBack(frame));
}

/// Gives back the images of a frame, and those before them.
void Wiring::release(const StereoFrame& frame) {
  for (std::size_t c = 0; c < rig_.camera_count; ++c) {
    Camera& camera = camera_[c];
    std::size_t done = 0;
    while (done < camera.held_count && camera.held[done]->frame.number <= frame.number[c]) ++done;
    for (std::size_t i = 0; i < done; ++i) camera.held[i].reset();
    for (std::size_t i = done; i < camera.held_count; ++i) camera.held[i - done] = std::move(camera.held[i]);
    camera.held_count -= done;
  }
}

const CameraFrame& Wiring::headOf(std::size_t camera) const {
  return camera_[camera].held[camera_[camera].held_count - 1]->frame;
}

/// Of the image that came last.
HostTimes Wiring::hostTimesOf(const StereoFrame& frame) const {
  HostTimes times;
  for (std::size_t c = 0; c < rig_.camera_count; ++c) {
    const Camera& camera = camera_[c];
    for (std::size_t i = 0; i < camera.held_count; ++i) {
      const ImageSlot& slot = *camera.held[i];
      if (slot.frame.number != frame.number[c] || slot.host.arrival < times.arrival) continue;
      times = slot.host;
    }
  }
  return times;
}

/// The one in work included.
int Wiring::waitingFrames() const {
  return static_cast<int>(tracking_.waiting.size() + camera_[0].ring.size());
}

bool Wiring::trackFrame() {
  const StereoFrame frame = tracking_.waiting.front();
  TrackMessage& message = *tracked_ring_.beginPush();  // track() has made sure of room
  message.kind = TrackMessage::Kind::kFrame;
  message.host = hostTimesOf(frame);
  TrackStep& step = message.step;
  step.frame = frame.index;
  step.stamp = frame.stamp;
  step.image = frame.number;
  const double age = wallSeconds() - message.host.arrival;
  step.effort = track_effort_->give();
  message.effort_level = track_effort_->level();
  message.spent = measured([&] {
    const double cpu = threadCpuSeconds();
    step.window = window_.refresh();
    if (step.window != tracking_.window) {
      tracking_.window = step.window;
      track_.take(window_.value());
    }
    tracking_.samples +=
        takeSamples(imu_to_track_, frame.stamp, [this](const ImuSample& sample) { track_.addImu(sample); });
    step.samples = tracking_.samples;
    message.status = track_.step(frame, step.effort, message.tracked);
    if (drag_) drag_(StageId::kTrack, threadCpuSeconds() - cpu);
  });
  track_effort_->took({message.spent.wall, waitingFrames() - 1, age});
  const bool tracked = message.status.ok();
  if (!tracked) message.kind = TrackMessage::Kind::kFrameRefused;
  message.dropped = tracking_.dropped;
  tracking_.dropped = 0;
  addTime(times_, StageId::kTrack, message.spent, tracked && message.tracked.keyframe);
  if (to_recorder_) static_cast<void>(to_recorder_->track.tryPush(step));
  const bool to_loop = to_loop_ && tracked && message.tracked.keyframe;
  const bool to_map = to_map_ && wantsMap(frame, tracked && message.tracked.keyframe) && tracked;
  message.mapped = (to_loop || to_map) && copyImages(frame, to_loop, to_map);
  tracked_ring_.commitPush();
  release(frame);
  tracking_.waiting.erase(0);
  return true;
}

/// The input has ended: what waits for a partner goes out alone, then the end is told. True: come again.
bool Wiring::endTracking() {
  if (trackDone()) return false;
  if (pairing_.flush(tracking_.paired).ok()) {
    queueFrame(tracking_.paired);
    return true;
  }
  TrackMessage* message = tracked_ring_.size() < kTrackedRing ? tracked_ring_.beginPush() : nullptr;
  if (message == nullptr) return false;
  message->kind = TrackMessage::Kind::kEnd;
  message->status = okStatus();
  message->step = TrackStep{};
  message->step.stamp = kEndOfTime;
  message->spent = {};
  message->dropped = tracking_.dropped;
  counters_.track.pairing = pairing_.counters();
  tracked_ring_.commitPush();
  track_done_.store(true, std::memory_order_release);
  return true;
}

}  // namespace swiftlet
