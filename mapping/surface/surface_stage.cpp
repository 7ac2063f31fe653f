#include "mapping/surface/surface_stage.hpp"

#include <algorithm>

namespace swiftlet {

SurfaceStage::SurfaceStage(VoxelVolume& volume, const ConfusionModel& confusion, SurfaceStore& store,
                           const SurfaceSettings& settings)
    : volume_(volume),
      store_(store),
      surface_(volume, confusion, settings),
      seen_(volume.slots(), 0),
      is_old_(volume.slots(), 0) {
  pass_.reserve(volume.slots());
  (void)volume.addListener(this);
}

std::size_t SurfaceStage::bytes() const {
  return sizeof(*this) + seen_.size() * sizeof(std::uint32_t) + is_old_.size() +
         pass_.capacity() * sizeof(Waiting);
}

void SurfaceStage::drawAll() {
  std::fill(seen_.begin(), seen_.end(), 0);
  std::fill(is_old_.begin(), is_old_.end(), std::uint8_t{0});
  old_count_ = 0;
  pass_.clear();
  next_ = 0;
}

void SurfaceStage::findChanges() {
  for (std::uint32_t slot = 0; slot < volume_.slots(); ++slot) {
    const BlockHeader& header = volume_.header(slot);
    if (header.revision == seen_[slot]) continue;
    seen_[slot] = header.revision;
    if (header.state == BlockState::kUnused) {
      old_count_ -= is_old_[slot];
      is_old_[slot] = 0;
      continue;
    }
    if (header.state == BlockState::kFree) {
      if (!header.isWhollyFree()) continue;
      // The surface that it had before no longer exists.
      store_.takeOut(header.index);
    }
    for (int z = -1; z <= 1; ++z) {
      for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
          const std::uint32_t near = volume_.find(header.index + BlockIndex{x, y, z});
          if (near == VoxelVolume::kNone || volume_.header(near).state != BlockState::kVoxels) continue;
          old_count_ += is_old_[near] == 0 ? 1U : 0U;
          is_old_[near] = 1;
        }
      }
    }
  }
}

void SurfaceStage::beginPass() {
  pass_.clear();
  next_ = 0;
  for (std::uint32_t slot = 0; slot < volume_.slots(); ++slot) {
    if (is_old_[slot] == 0) continue;
    const float squared = (volume_.centreOf(volume_.header(slot).index) - vehicle_).squaredNorm();
    pass_.push_back({squared, slot});
  }
  std::sort(pass_.begin(), pass_.end());
}

void SurfaceStage::draw(std::uint32_t slot) {
  old_count_ -= is_old_[slot];
  is_old_[slot] = 0;
  surface_.extract(slot, patch_);
  store_.put(patch_, vehicle_);
  ++counters_.drawn;
}

Status SurfaceStage::step(const Eigen::Vector3f& vehicle, const SurfaceEffort& effort, SurfaceStep& out) {
  out = {};
  vehicle_ = vehicle;
  findChanges();
  while (old_count_ > 0 && out.drawn < effort.blocks) {
    if (next_ == pass_.size()) beginPass();
    const std::uint32_t slot = pass_[next_++].slot;
    if (is_old_[slot] == 0) continue;
    draw(slot);
    ++out.drawn;
  }
  out.waiting = old_count_;
  if (out.waiting > 0)
    return {StatusCode::kCapacityReached, "surface: changed blocks wait for the next step"};
  return okStatus();
}

void SurfaceStage::beforeRemoval(const VoxelVolume& volume, std::span<const std::uint32_t> slots) {
  findChanges();
  for (const std::uint32_t slot : slots) {
    if (volume.header(slot).state == BlockState::kUnused) continue;
    const BlockIndex index = volume.header(slot).index;
    // The block's own cubes, and those of the blocks below that reach into it.
    for (int z = -1; z <= 0; ++z) {
      for (int y = -1; y <= 0; ++y) {
        for (int x = -1; x <= 0; ++x) {
          const std::uint32_t near = volume.find(index + BlockIndex{x, y, z});
          if (near == VoxelVolume::kNone || is_old_[near] == 0) continue;
          draw(near);
        }
      }
    }
  }
}

}  // namespace swiftlet
