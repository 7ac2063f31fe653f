#include "mapping/map/volume_correction.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace swiftlet {
namespace {

/// What moves less than this part of a voxel is not worth fusing again.
constexpr double kTolerance = 0.5;
/// A block nearer than this [m] to the camera's plane is not projected.
constexpr double kNearestBlock = 0.1;

}  // namespace

VolumeCorrection::VolumeCorrection(VoxelVolume& volume, VolumeIntegrator& integrator, SurfaceStore& store,
                                   std::size_t bytes, std::size_t most_pixels)
    : volume_(volume),
      integrator_(integrator),
      store_(store),
      kept_(bytes, most_pixels, volume.settings().most_range) {
  if (kept_.capacity() == 0) return;
  // At most as many as there are pixels.
  tiles_.deepest.reserve(kept_.mostPixels());
  leaving_.reserve(volume.slots());
  dropped_.reserve(volume.slots());
}

std::size_t VolumeCorrection::bytes() const {
  return kept_.bytes() + leaving_.capacity() * sizeof(std::uint32_t) +
         dropped_.capacity() * sizeof(BlockIndex) + tiles_.deepest.capacity() * sizeof(float);
}

void VolumeCorrection::keep(const DepthImageView& image, std::uint64_t frame, const SE3& T_map_world,
                            const SE3& T_world_body) {
  KeptFrame about;
  about.frame = frame;
  about.T_map_world = T_map_world;
  about.T_world_body = T_world_body;
  about.T_map_fused = about.T_map_body();
  about.fused = true;
  about.since = volume_.revision();
  // The one that makes room may be waiting itself.
  if (kept_.keep(image, about) != KeptDepths::kNone && waiting_ > 0) countWaiting();
}

void VolumeCorrection::countWaiting() {
  waiting_ = 0;
  for (std::size_t i = 0; i < kept_.size(); ++i) waiting_ += kept_.frame(i).pending ? 1 : 0;
}

void VolumeCorrection::refine(std::span<const RefinedPose> poses) {
  if (kept_.size() == 0) return;
  bool any = false;
  for (std::size_t i = 0; i < kept_.size(); ++i) {
    KeptFrame& frame = kept_.frame(i);
    const auto at = std::ranges::lower_bound(poses, frame.frame, {}, &RefinedPose::frame);
    if (at == poses.end() || at->frame != frame.frame) continue;
    frame.T_world_body = at->T_world_body;
    any = any || isOutOfPlace(frame);
  }
  if (any) begin();
}

void VolumeCorrection::correct(std::span<const WorldInMap> worlds) {
  if (worlds.empty()) return;
  bool any = false;
  for (std::size_t i = 0; i < kept_.size(); ++i) {
    KeptFrame& frame = kept_.frame(i);
    const auto after = std::ranges::lower_bound(worlds, frame.frame, {}, &WorldInMap::frame);
    if (after == worlds.end() || after == worlds.begin() || after->frame == frame.frame) {
      frame.T_map_world = after == worlds.end() ? worlds.back().T_map_world : after->T_map_world;
    } else {
      const WorldInMap& before = *std::prev(after);
      const double part =
          static_cast<double>(frame.frame - before.frame) / static_cast<double>(after->frame - before.frame);
      // The map moves the bodies, not the far origin of the world: a body's place is interpolated, lest a
      // turn about that origin be taken for a shift.
      const SE3 a = before.T_map_world * frame.T_world_body, b = after->T_map_world * frame.T_world_body;
      SE3 body;
      body.rotation = a.rotation.slerp(part, b.rotation);
      body.translation = (1 - part) * a.translation + part * b.translation;
      frame.T_map_world = body * frame.T_world_body.inverse();
    }
    any = any || isOutOfPlace(frame);
  }
  if (any) begin();
}

bool VolumeCorrection::isOutOfPlace(const KeptFrame& frame) const {
  if (!frame.fused) return false;
  const SE3 now = frame.T_map_body();
  const double shift =
      (now.translation - frame.T_map_fused.translation).norm() +
      static_cast<double>(frame.mean_depth) * now.rotation.angularDistance(frame.T_map_fused.rotation);
  return shift > kTolerance * volume_.settings().voxel_size;
}

bool VolumeCorrection::sees(const PinholeIntrinsics& camera, const SE3& T_camera_map,
                            const BlockIndex& block) const {
  const Eigen::Vector3d p = T_camera_map * volume_.centreOf(block).cast<double>();
  const double radius = 0.5 * std::sqrt(3.0) * static_cast<double>(volume_.blockSize());
  if (p.z() < -radius || p.z() > volume_.settings().most_range + volume_.settings().truncation + radius) {
    return false;
  }
  // Around the projected ball; beside the camera that is a half space.
  const double z = p.z() - radius;
  double left = 0, top = 0, right = camera.width - 1, bottom = camera.height - 1;
  if (z > kNearestBlock) {
    left = std::max(left, camera.cx + camera.fx * std::min((p.x() - radius) / z, (p.x() - radius) / p.z()));
    right = std::min(right, camera.cx + camera.fx * std::max((p.x() + radius) / z, (p.x() + radius) / p.z()));
    top = std::max(top, camera.cy + camera.fy * std::min((p.y() - radius) / z, (p.y() - radius) / p.z()));
    bottom =
        std::min(bottom, camera.cy + camera.fy * std::max((p.y() + radius) / z, (p.y() + radius) / p.z()));
  }
  if (left > right || top > bottom) return false;
  const auto tile = [](double pixel) { return static_cast<int>(pixel) / DepthTiles::kSide; };
  const auto nearest = static_cast<float>(z - volume_.settings().truncation);
  for (int row = tile(top); row <= tile(bottom); ++row) {
    for (int column = tile(left); column <= tile(right); ++column) {
      const float deepest = tiles_.deepest[static_cast<std::size_t>(row * tiles_.columns + column)];
      if (deepest > 0 && deepest >= nearest) return true;
    }
  }
  return false;
}

void VolumeCorrection::begin() {
  ++counters_.corrections;
  dropSeen();
  for (std::size_t i = 0; i < kept_.size(); ++i) {
    KeptFrame& frame = kept_.frame(i);
    if (frame.pending || dropped_.empty()) continue;
    kept_.deepestOf(i, tiles_);
    const SE3 T_camera_map = (frame.T_map_body() * frame.T_body_camera).inverse();
    frame.pending = std::ranges::any_of(
        dropped_, [&](const BlockIndex& block) { return sees(frame.camera, T_camera_map, block); });
  }
  countWaiting();
}

void VolumeCorrection::dropSeen() {
  leaving_.clear();
  for (std::uint32_t slot = 0; slot < volume_.slots(); ++slot) {
    if (volume_.header(slot).state != BlockState::kUnused) leaving_.push_back(slot);
  }
  // Of these, those that no image out of place saw go to the front.
  auto seen = leaving_.end();
  for (std::size_t i = 0; i < kept_.size(); ++i) {
    KeptFrame& frame = kept_.frame(i);
    if (!isOutOfPlace(frame)) continue;
    ++counters_.images_moved;
    kept_.deepestOf(i, tiles_);
    const SE3 T_camera_map = (frame.T_map_fused * frame.T_body_camera).inverse();
    seen = std::partition(leaving_.begin(), seen, [&](std::uint32_t slot) {
      return !sees(frame.camera, T_camera_map, volume_.header(slot).index);
    });
    frame.fused = false;
    frame.since = 0;
    frame.pending = true;
  }
  std::sort(seen, leaving_.end());
  dropped_.clear();
  for (auto slot = seen; slot != leaving_.end(); ++slot) {
    const BlockIndex block = volume_.header(*slot).index;
    dropped_.push_back(block);
    store_.takeOut(block);
  }
  volume_.discard({leaving_.data() + (seen - leaving_.begin()), dropped_.size()});
  counters_.blocks_dropped += dropped_.size();
}

std::size_t VolumeCorrection::nearestPending(const Eigen::Vector3f& vehicle) const {
  std::size_t nearest = KeptDepths::kNone;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < kept_.size(); ++i) {
    const KeptFrame& frame = kept_.frame(i);
    if (!frame.pending) continue;
    const double distance = (frame.T_map_body().translation - vehicle.cast<double>()).norm();
    if (distance < least) {
      least = distance;
      nearest = i;
    }
  }
  return nearest;
}

void VolumeCorrection::step(const Eigen::Vector3f& vehicle, const CorrectionEffort& effort,
                            CorrectionStep& out) {
  out = {};
  for (std::uint32_t blocks = 0; waiting_ > 0 && blocks < effort.blocks;) {
    const std::size_t i = nearestPending(vehicle);
    KeptFrame& frame = kept_.frame(i);
    VolumeStep fused;
    // The poses were finite when the image was fused first; corrections are.
    static_cast<void>(integrator_.again(kept_.read(i), frame.T_map_body(), frame.since, vehicle, {}, fused));
    frame.pending = false;
    frame.fused = true;
    frame.T_map_fused = frame.T_map_body();
    frame.since = volume_.revision();
    blocks += fused.updated + fused.carved + 1;
    --waiting_;
    ++out.images;
  }
  out.waiting = waiting_;
}

void VolumeCorrection::restart() {
  kept_.clear();
  waiting_ = 0;
}

}  // namespace swiftlet
