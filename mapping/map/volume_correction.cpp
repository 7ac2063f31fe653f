#include "mapping/map/volume_correction.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace swiftlet {
namespace {

/// What moves less than this part of a voxel is not worth fusing again.
constexpr double kTolerance = 0.5;
/// How much wider than the image a view is taken to be: blocks are judged by their centres.
constexpr double kViewMargin = 1.1;

}  // namespace

VolumeCorrection::VolumeCorrection(VoxelVolume& volume, VolumeIntegrator& integrator, SurfaceStore& store,
                                   std::size_t bytes, std::size_t most_pixels)
    : volume_(volume),
      integrator_(integrator),
      store_(store),
      kept_(bytes, most_pixels, volume.settings().most_range) {
  if (kept_.capacity() == 0) return;
  leaving_.reserve(volume.slots());
  dropped_.reserve(volume.slots());
}

std::size_t VolumeCorrection::bytes() const {
  return kept_.bytes() + leaving_.capacity() * sizeof(std::uint32_t) +
         dropped_.capacity() * sizeof(BlockIndex);
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

bool VolumeCorrection::sees(const KeptFrame& frame, const SE3& T_camera_map, const BlockIndex& block) const {
  const Eigen::Vector3d p = T_camera_map * volume_.centreOf(block).cast<double>();
  const double radius = 0.5 * std::sqrt(3.0) * static_cast<double>(volume_.blockSize());
  const double most = static_cast<double>(frame.deepest) + volume_.settings().truncation + radius;
  if (p.z() < -radius || p.z() > most) return false;
  const PinholeIntrinsics& c = frame.camera;
  const double wide = kViewMargin * std::max(c.cx, c.width - c.cx) / c.fx;
  const double high = kViewMargin * std::max(c.cy, c.height - c.cy) / c.fy;
  const double z = std::max(p.z(), 0.0);
  // A plane of the pyramid of view stands askew: as far from it as the radius is farther along an axis.
  return std::abs(p.x()) < wide * z + radius * std::sqrt(1 + wide * wide) &&
         std::abs(p.y()) < high * z + radius * std::sqrt(1 + high * high);
}

void VolumeCorrection::begin() {
  ++counters_.corrections;
  dropSeen();
  for (std::size_t i = 0; i < kept_.size(); ++i) {
    KeptFrame& frame = kept_.frame(i);
    const SE3 T_camera_map = (frame.T_map_body() * frame.T_body_camera).inverse();
    for (std::size_t k = 0; k < dropped_.size() && !frame.pending; ++k) {
      frame.pending = sees(frame, T_camera_map, dropped_[k]);
    }
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
    const SE3 T_camera_map = (frame.T_map_fused * frame.T_body_camera).inverse();
    seen = std::partition(leaving_.begin(), seen, [&](std::uint32_t slot) {
      return !sees(frame, T_camera_map, volume_.header(slot).index);
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
    if (store_.find(block) == SurfaceStore::kNone) continue;
    empty_.block = block;
    store_.put(empty_, {});
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
    static_cast<void>(integrator_.again(kept_.read(i), frame.T_map_body(), frame.since, {}, fused));
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
