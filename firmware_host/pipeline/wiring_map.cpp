// The thread `map`: frames with their images, depth and labels, to volume, surface and distance field.
//
// Mapped are: with a depth sensor, frames that have a depth image; else keyframes seen by both cameras, and
// frames that have labels. Where labels come after their images (Options::labels) frames are held for them.

#include <algorithm>

#include "firmware_host/pipeline/packed_copy.hpp"
#include "firmware_host/pipeline/wiring.hpp"

namespace swiftlet {

// depth, labels -> slot -> map; their stamp -> track
void Wiring::takeScene(const SceneImages& scene) {
  if (!to_map_ || scene.empty()) return;
  auto& counters = counters_.sensor;
  ++counters.scenes;
  MapArrows& arrows = *to_map_;
  const SlotHandle handle = arrows.scenes.tryAcquire();
  if (!handle.valid()) {
    ++counters.scenes_dropped;
    return;
  }
  SceneSlot& slot = arrows.scenes.fill(handle);
  slot.images = SceneImages{};
  slot.images.stamp = scene.stamp;
  if (const DepthImageView& from = scene.depth; from.depth != nullptr && mapping_.from_sensor) {
    if (from.camera.pixels() == slot.depth.size()) {
      std::copy_n(from.depth, slot.depth.size(), slot.depth.begin());
      slot.images.depth = from;
      slot.images.depth.depth = slot.depth.data();
    } else {
      ++counters.depths_wrong_size;
    }
  }
  if (const ImageView& from = scene.labels; !from.empty() && !slot.labels.empty()) {
    if (from.width == rig_.camera[0].width() && from.height == rig_.camera[0].height()) {
      slot.images.labels = packedCopy(from, slot.labels.data());
    } else {
      ++counters.labels_wrong_size;
    }
  }
  if (!slot.images.empty()) {
    const SceneNote note{scene.stamp, slot.images.depth.depth != nullptr, !slot.images.labels.empty()};
    if (!arrows.scenes.tryHand(handle, 0)) {
      ++counters.scenes_dropped;
    } else if (SlotHandle dropped; arrows.scene.push(handle, dropped)) {
      arrows.scenes.takeBack(dropped, 0);
      ++counters.scenes_dropped;
    }
    static_cast<void>(arrows.notes.tryPush(note));  // refusals are counted by the ring
  }
  arrows.scenes.finish(handle);
}

template <typename Work>
void Wiring::timed(StageId stage, Work&& work) {
  addTime(times_, stage, measured([&] {
            const double cpu = threadCpuSeconds();
            work();
            if (drag_) drag_(stage, threadCpuSeconds() - cpu);
          }));
}

bool Wiring::wantsMap(const StereoFrame& frame, bool keyframe) {
  bool depth = false, labels = false;
  while (const SceneNote* note = to_map_->notes.front()) {
    if (note->stamp > frame.stamp) break;
    if (note->stamp == frame.stamp) {
      depth = note->depth;
      labels = note->labels;
    }
    to_map_->notes.pop();
  }
  if (mapping_.from_sensor) return depth;
  return (keyframe || labels) && frame.has(0) && frame.has(1);
}

// track: a frame's images -> copies -> loop, map; whether the map gets them
bool Wiring::copyImages(const StereoFrame& frame, bool to_loop, bool to_map) {
  KeyframePool& pool = *keyframe_images_;
  const SlotHandle handle = pool.tryAcquire();
  if (!handle.valid()) {
    if (to_loop) ++to_loop_->images_dropped;
    if (to_map) ++to_map_->images_dropped;
    return false;
  }
  KeyframeImages& images = pool.fill(handle);
  images.frame = frame.index;
  images.number = frame.number;
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    images.image[c] = packedCopy(frame.image[c], images.pixels[c].data());
  }
  const auto hand = [&](KeyframeReader reader, auto& ring, std::uint64_t& dropped_count) {
    SlotHandle dropped;
    if (!pool.tryHand(handle, reader)) {
      ++dropped_count;
      return false;
    }
    if (ring.push(handle, dropped)) {
      pool.takeBack(dropped, reader);
      ++dropped_count;
    }
    return true;
  };
  if (to_loop) static_cast<void>(hand(kLoopReads, to_loop_->images, to_loop_->images_dropped));
  const bool mapped = to_map && hand(kMapReads, to_map_->images, to_map_->images_dropped);
  pool.finish(handle);
  return mapped;
}

// smooth -> frame with its window's poses -> map
void Wiring::handFrame(const TrackMessage& message, const SmoothedWindow& window) {
  const Health health = window.newest.health;
  // Where the pose is not to be flown on, or still being found, there is nothing to map.
  if (window.poses.empty() || (health != Health::kGood && health != Health::kDegraded)) return;
  MapMessage* out = to_map_->frames.beginPush();
  if (out == nullptr) return;  // counted by the ring
  out->frame = message.tracked.index;
  out->stamp = message.tracked.stamp;
  out->epoch = window.epoch;
  out->poses = window.poses;
  to_map_->frames.commitPush();
}

// frames with poses, images, depth, labels, newest correction -> depth -> volume -> surface, distance field
bool Wiring::map() {
  const bool ended = smoothDone() && loopDone();
  if (held_) {
    holdFrames();
    return mapHeldFrame() || mapLeftOver(ended && held_->empty());
  }
  const MapMessage* message = to_map_ ? to_map_->frames.front() : nullptr;
  if (message == nullptr) return mapLeftOver(ended);
  ++counters_.map.frames;
  correctMap(*message);
  if (findMapImages(message->frame)) {
    mapFrame(*message, mapping_.images->image,
             findScene(message->stamp) ? mapping_.scene->images : SceneImages{});
  } else {
    ++counters_.map.without_image;
  }
  to_map_->frames.pop();
  if (map_->isCorrecting()) stepCorrection();
  return true;
}

// frames with poses, images, depth -> held for their labels
void Wiring::holdFrames() {
  while (const MapMessage* message = held_->full() ? nullptr : to_map_->frames.front()) {
    const bool has_images = findMapImages(message->frame);
    const SceneImages scene =
        has_images && findScene(message->stamp) ? mapping_.scene->images : SceneImages{};
    held_->hold(*message, has_images ? &*mapping_.images : nullptr, scene, wallSeconds());
    to_map_->frames.pop();
  }
}

/// The oldest of those held, where it need not wait any more.
bool Wiring::mapHeldFrame() {
  const HeldFrames::Frame* frame = held_->due(wallSeconds());
  if (frame == nullptr) return false;
  ++counters_.map.frames;
  correctMap(frame->message);
  if (frame->has_images) {
    mapFrame(frame->message, frame->image, frame->scene);
  } else {
    ++counters_.map.without_image;
  }
  held_->drop();
  if (map_->isCorrecting()) stepCorrection();
  return true;
}

/// What is to do while no frame is there; `ended`: none will come.
bool Wiring::mapLeftOver(bool ended) {
  if (map_ && map_->isCorrecting()) {
    stepCorrection();
    return true;
  }
  if (map_ && map_->counters().taken > 0 && !ended && !mapping_.report.distance.caught_up) {
    // Time that no frame asks for: waves that the last step left.
    timed(StageId::kDistance, [&] { map_->updateDistance(mapping_.vehicle, {}, mapping_.report); });
    return true;
  }
  if (ended && !mapDone()) {
    if (map_) map_->drawRest();
    mapping_.images.reset();
    mapping_.scene.reset();
    map_done_.store(true, std::memory_order_release);
  }
  return false;
}

// newest window, newest correction -> poses of what was fused before
void Wiring::correctMap(const MapMessage& message) {
  mapping_.refined.clear();
  for (const WindowPose& pose : message.poses) {
    static_cast<void>(mapping_.refined.tryPushBack({pose.frame_index, pose.T_world_body}));
  }
  map_->refine({mapping_.refined.data(), mapping_.refined.size()});
  const std::uint64_t number = to_map_->correction.refresh();
  if (number == mapping_.correction) return;
  mapping_.correction = number;
  const WorldsInMap& worlds = to_map_->correction.value();
  if (worlds.newest.epoch == message.epoch) map_->correct({worlds.keyframes.data(), worlds.keyframes.size()});
}

// what turned out to be out of place -> volume -> surface, distance field
void Wiring::stepCorrection() {
  timed(StageId::kCorrection, [&] { map_->stepCorrection({}, mapping_.corrected); });
  if (mapping_.corrected.waiting == 0) drawMap();
}

void Wiring::mapFrame(const MapMessage& message, const std::array<ImageView, kMaxCameras>& image,
                      const SceneImages& scene) {
  MapInput input;
  input.stamp = message.stamp;
  input.frame = message.frame;
  input.epoch = message.epoch;
  input.T_map_body = message.poses.back().T_world_body;
  if (const MapCorrection& now = to_map_->correction.value().newest;
      mapping_.correction > 0 && now.epoch == message.epoch) {
    input.T_map_world = now.T_map_world;
    input.T_map_body = now.T_map_world * input.T_map_body;
  }
  input.image = image;
  input.depth = scene.depth;
  input.labels = scene.labels;
  if (mapping_.from_sensor && scene.empty()) {
    ++counters_.map.without_scene;
    return;
  }
  MapStage& map = *map_;
  MapReport& report = mapping_.report;
  timed(StageId::kDepth, [&] { static_cast<void>(map.measure(input, {}, report)); });
  if (report.status.ok()) {
    timed(StageId::kVolume, [&] { static_cast<void>(map.integrate(input, {}, report)); });
  }
  if (report.status.code == StatusCode::kInvalidInput) {
    ++counters_.map.refused;
    counters_.map.faults.add(report.status);
    return;
  }
  mapping_.vehicle = input.T_map_body.translation;
  drawMap();
  publishSurface(message.stamp);
}

void Wiring::drawMap() {
  // What is left over is counted in the report and drawn later.
  timed(StageId::kSurface, [&] { static_cast<void>(map_->draw(mapping_.vehicle, {}, mapping_.report)); });
  timed(StageId::kDistance, [&] { map_->updateDistance(mapping_.vehicle, {}, mapping_.report); });
}

// map -> newest surface, to each who asks for it
void Wiring::publishSurface(Stamp stamp) {
  struct Gather : SurfaceSink {
    explicit Gather(std::vector<SurfaceVertex>& to) : vertices(to) {}
    void take(const SurfacePatch& patch) override {
      const std::size_t room = SurfaceNews::kMost - vertices.size();
      vertices.insert(
          vertices.end(), patch.vertices.begin(),
          patch.vertices.begin() + static_cast<std::ptrdiff_t>(std::min(room, patch.vertices.size())));
    }
    std::vector<SurfaceVertex>& vertices;
  };
  for (LiveOutlet* outlet : outlets_) {
    if (!outlet->surface_wanted.exchange(false, std::memory_order_acq_rel)) continue;
    SurfaceNews& out = outlet->surface.draft();
    out.stamp = stamp;
    out.vertices.clear();
    Gather gather(out.vertices);
    map_->visitSurface(gather);
    outlet->surface.publish();
  }
}

bool Wiring::findMapImages(std::uint64_t frame) {
  return bringToHead(*keyframe_images_, kMapReads, to_map_->images, mapping_.images, frame,
                     [](const KeyframeImages& images) { return images.frame; });
}

bool Wiring::findScene(Stamp stamp) {
  return bringToHead(to_map_->scenes, 0, to_map_->scene, mapping_.scene, stamp,
                     [](const SceneSlot& slot) { return slot.images.stamp; });
}

}  // namespace swiftlet
