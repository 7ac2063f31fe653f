// The thread `mesh`: the newest window, and the image of its frame.

#include "firmware_host/pipeline/wiring.hpp"

namespace swiftlet {

// slot -> mesh
void Wiring::handToMesh(SlotHandle handle) {
  ImagePool& pool = camera_[0].pool;
  if (!pool.tryHand(handle, kMeshReads)) {
    ++counters_.sensor.images_unmeshed;
    return;
  }
  SlotHandle dropped;
  if (!image_to_mesh_.push(handle, dropped)) return;
  pool.takeBack(dropped, kMeshReads);
  ++counters_.sensor.images_unmeshed;
}

// smooth -> newest window, for track and, with its frame, for mesh; keyframes for loop
void Wiring::publishWindow(const TrackMessage& message) {
  SmoothedWindow& window = window_.draft();
  smooth_.window(window);
  if (mesh_) {
    MeshMessage& to_mesh = window_to_mesh_.draft();
    to_mesh.window = window;
    to_mesh.tracked = message.tracked;
    to_mesh.image = message.step.image[0];
    window_to_mesh_.publish();
  }
  if (to_loop_ && message.tracked.keyframe && window.started) handKeyframe(message);
  if (to_map_ && message.mapped && window.started) handFrame(message, window);
  smoothing_.windows = window_.publish();
}

// newest window, image -> mesh -> newest mesh, planes; every mesh where it is wanted
bool Wiring::mesh() {
  const bool ended = smoothDone();
  const std::uint64_t number = mesh_ ? window_to_mesh_.refresh() : 0;
  if (number == meshing_.window) {
    if (ended) {
      meshing_.image.reset();
      mesh_done_.store(true, std::memory_order_release);
    }
    return false;
  }
  counters_.mesh.skipped += number - meshing_.window - 1;
  meshing_.window = number;
  meshFrame(window_to_mesh_.value());
  return true;
}

void Wiring::meshFrame(const MeshMessage& message) {
  const bool has_image = findMeshImage(message.image);
  if (!message.hasPose()) return;
  if (!has_image) ++counters_.mesh.without_image;
  const MeshStep step{message.tracked.index, meshing_.window, has_image ? message.image : 0};
  MeshInput input;
  input.window = &message.window;
  input.tracks = &message.tracked;
  if (has_image) input.image = meshing_.image->frame.image;
  Status status;
  const Spent spent = measured([&] {
    const double cpu = threadCpuSeconds();
    status = mesh_->step(input);
    // What was refused is in the stage's counters.
    if (status.code != StatusCode::kInvalidInput) publishMesh(message.tracked.keyframe);
    if (drag_) drag_(StageId::kMesh, threadCpuSeconds() - cpu);
  });
  addTime(times_, StageId::kMesh, spent, message.tracked.keyframe);
  if (to_recorder_) static_cast<void>(to_recorder_->mesh.tryPush(step));
}

bool Wiring::findMeshImage(std::uint64_t number) {
  return number > 0 && bringToHead(camera_[0].pool, kMeshReads, image_to_mesh_, meshing_.image, number,
                                   [](const ImageSlot& slot) { return slot.frame.number; });
}

void Wiring::publishMesh(bool keyframe) {
  mesh_->horizonMesh(local_mesh_.draft());
  local_mesh_.publish();
  for (LiveOutlet* outlet : outlets_) {
    mesh_->horizonMesh(outlet->mesh.draft());
    outlet->mesh.publish();
  }
  if (const PlaneReport* planes = mesh_->newPlanes()) {
    planes_.draft() = *planes;
    planes_.publish();
  }
  if (!meshes_) return;
  MeshResult* out = meshes_->beginPush();
  if (out == nullptr) return;  // counted by the ring
  out->keyframe = keyframe;
  mesh_->frameMesh(out->frame);
  if (keyframe) mesh_->horizonMesh(out->horizon);
  out->hull.clear();
  for (const Eigen::Vector2f& corner : mesh_->hull()) static_cast<void>(out->hull.tryPushBack(corner));
  meshes_->commitPush();
}

}  // namespace swiftlet
