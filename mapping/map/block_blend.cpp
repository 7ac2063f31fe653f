#include "mapping/map/block_blend.hpp"

#include <algorithm>
#include <cmath>

#include "mapping/volume/block_update.hpp"

namespace swiftlet {
namespace {

/// Largest number of blocks along an axis that a block turned by any angle touches.
constexpr int kMostAlong = 4;

Eigen::Vector3d firstOf(const BlockIndex& block) {
  return kBlockSide * Eigen::Vector3d(block.x, block.y, block.z);
}

BlockRange common(const BlockRange& a, const BlockRange& b) {
  return {{std::max(a.low.x, b.low.x), std::max(a.low.y, b.low.y), std::max(a.low.z, b.low.z)},
          {std::min(a.high.x, b.high.x), std::min(a.high.y, b.high.y), std::min(a.high.z, b.high.z)}};
}

template <typename Take>
void forBlocks(const BlockRange& range, const Take& take) {
  for (std::int32_t z = range.low.z; z <= range.high.z; ++z) {
    for (std::int32_t y = range.low.y; y <= range.high.y; ++y) {
      for (std::int32_t x = range.low.x; x <= range.high.x; ++x) take(BlockIndex{x, y, z});
    }
  }
}

/// Index of a block in the range, x fastest.
std::size_t numberIn(const BlockRange& range, const BlockIndex& block) {
  const auto along = [](std::int32_t low, std::int32_t at) { return static_cast<std::size_t>(at - low); };
  const std::size_t wide = along(range.low.x, range.high.x) + 1, deep = along(range.low.y, range.high.y) + 1;
  return along(range.low.x, block.x) +
         wide * (along(range.low.y, block.y) + deep * along(range.low.z, block.z));
}

std::size_t blocksIn(const BlockRange& range) { return numberIn(range, range.high) + 1; }

/// The parts of which all voxels are in the set.
std::uint64_t wholeParts(const std::bitset<kBlockVoxels>& voxels) {
  std::uint64_t parts = kAllParts;
  for (std::size_t at = 0; at < kBlockVoxels; ++at) {
    if (!voxels[at]) parts &= ~partBitAt(at);
  }
  return parts;
}

/// Slope of the distance along one axis, from the known neighbours [steps per voxel].
float slopeAt(const VoxelBlock& block, std::size_t at, int along, std::size_t stride) {
  const auto distance = [&](std::size_t i) { return static_cast<float>(block.distance[i]); };
  const bool before = along > 0 && block.weight[at - stride] > 0;
  const bool after = along < kBlockSide - 1 && block.weight[at + stride] > 0;
  if (before && after) return 0.5F * (distance(at + stride) - distance(at - stride));
  if (after) return distance(at + stride) - distance(at);
  return before ? distance(at) - distance(at - stride) : 0;
}

}  // namespace

BlockBlend::BlockBlend(VoxelVolume& volume) : volume_(volume) {
  wanted_.reserve(std::size_t{kMostAlong} * kMostAlong * kMostAlong);
}

void BlockBlend::place(const StoredBlock& block, const SE3& motion) {
  block_ = &block;
  const double voxel = volume_.settings().voxel_size;
  const SE3 back = motion.inverse();
  to_block_ = back.R();
  // A voxel's centre is half a voxel from the corner at its index.
  const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.5);
  at_block_ = to_block_ * half + back.translation / voxel - half - firstOf(block.index);
  const Eigen::Vector3d centre =
      motion.R() * (firstOf(block.index) + Eigen::Vector3d::Constant(0.5 * kBlockSide)) +
      motion.translation / voxel;
  const Eigen::Vector3d extent = 0.5 * kBlockSide * motion.R().cwiseAbs().rowwise().sum();
  const auto block_at = [](const Eigen::Vector3d& voxels) {
    const Eigen::Vector3d b = (voxels / kBlockSide).array().floor();
    return BlockIndex{static_cast<std::int32_t>(b.x()), static_cast<std::int32_t>(b.y()),
                      static_cast<std::int32_t>(b.z())};
  };
  // Half a voxel less, because only voxel centres count.
  box_ = {block_at(centre - extent + half), block_at(centre + extent - half)};
}

bool BlockBlend::fallsIn(const VoxelIndex& voxel, std::size_t& at, Eigen::Vector3f& rest) const {
  const Eigen::Vector3d q = to_block_ * Eigen::Vector3d(voxel.x, voxel.y, voxel.z) + at_block_;
  const Eigen::Vector3d nearest = (q.array() + 0.5).floor();
  if (!((nearest.array() >= 0).all() && (nearest.array() < kBlockSide).all())) return false;
  at =
      offsetOf({static_cast<int>(nearest.x()), static_cast<int>(nearest.y()), static_cast<int>(nearest.z())});
  rest = (q - nearest).cast<float>();
  return true;
}

/// take(place in `to`, sample) for every voxel of `to` whose centre falls into a known one.
template <typename Take>
void BlockBlend::fill(const BlockIndex& to, const Take& take) const {
  const VoxelBlock& from = block_->voxels;
  Sample sample;
  Eigen::Vector3f rest;
  for (std::size_t at = 0; at < kBlockVoxels; ++at) {
    if (!fallsIn(voxelOf(to, at), sample.at, rest) || from.weight[sample.at] == 0) continue;
    const VoxelIndex within = voxelOf({}, sample.at);
    const Eigen::Vector3f slope(slopeAt(from, sample.at, within.x, 1),
                                slopeAt(from, sample.at, within.y, kBlockSide),
                                slopeAt(from, sample.at, within.z, std::size_t{kBlockSide} * kBlockSide));
    sample.distance = static_cast<float>(from.distance[sample.at]) + slope.dot(rest);
    take(at, sample);
  }
}

bool BlockBlend::reaches(const BlockIndex& to) const {
  bool any = false;
  fill(to, [&](std::size_t /*at*/, const Sample& /*sample*/) { any = true; });
  return any;
}

void BlockBlend::finish(std::uint32_t slot) {
  volume_.changeHeader(slot).sides = sidesOf(*volume_.voxels(slot));
  volume_.markChanged(slot);
}

void BlockBlend::add(const StoredBlock& block, const SE3& motion, const BlockRange& within) {
  place(block, motion);
  forBlocks(common(box_, within), [&](const BlockIndex& index) {
    if (block.free_parts != 0) {
      endWhatStands(index);
    } else {
      addVoxels(index);
    }
  });
}

/// take(block of the volume, its voxels whose middles fall into a free part of the moved block)
template <typename Take>
void BlockBlend::forFree(const BlockRange& within, const Take& take) const {
  std::size_t from = 0;
  Eigen::Vector3f rest;
  forBlocks(common(box_, within), [&](const BlockIndex& index) {
    VoxelSet free;
    for (std::size_t at = 0; at < kBlockVoxels; ++at) {
      if (fallsIn(voxelOf(index, at), from, rest)) free[at] = (block_->free_parts & partBitAt(from)) != 0;
    }
    if (free.any()) take(index, free);
  });
}

void BlockBlend::beginFree(const BlockRange& within) {
  free_range_ = within;
  free_.assign(blocksIn(within), {});
}

void BlockBlend::addFree(const StoredBlock& block, const SE3& motion) {
  place(block, motion);
  forFree(free_range_, [&](const BlockIndex& index, const VoxelSet& free) {
    free_[numberIn(free_range_, index)] |= free;
  });
}

void BlockBlend::endFree() {
  forBlocks(free_range_, [&](const BlockIndex& index) {
    const std::uint64_t parts = wholeParts(free_[numberIn(free_range_, index)]);
    if (parts == 0) return;
    const std::uint32_t slot = volume_.find(index);
    if (slot == VoxelVolume::kNone) {
      volume_.addFree(index, parts, {});
    } else if (volume_.voxels(slot) != nullptr) {
      fillFree(slot, parts);
    }
  });
}

/// Unknown voxels of the parts become free as by one image (VoxelVolume::obtain).
void BlockBlend::fillFree(std::uint32_t slot, std::uint64_t parts) {
  VoxelBlock& to = volume_.changeVoxels(slot);
  for (std::size_t at = 0; at < kBlockVoxels; ++at) {
    if (to.weight[at] > 0 || (parts & partBitAt(at)) == 0) continue;
    to.distance[at] = static_cast<std::int16_t>(kDistanceSteps);
    to.weight[at] = static_cast<std::uint16_t>(kWeightSteps);
    to.grey[at] = 0;
  }
  finish(slot);
}

void BlockBlend::addVoxels(const BlockIndex& index) {
  if (volume_.find(index) == VoxelVolume::kNone && !reaches(index)) return;
  const std::uint32_t slot = volume_.obtain(index);
  if (slot == VoxelVolume::kNone) return;
  const StoredBlock& block = *block_;
  VoxelBlock& to = volume_.changeVoxels(slot);
  LabelBlock* const labels = volume_.changeLabels(slot);
  const auto most_weight = static_cast<float>(volume_.settings().most_weight);
  fill(index, [&](std::size_t at, const Sample& sample) {
    const bool replaces = addVoxel(block.voxels, sample.at, sample.distance, most_weight, to, at);
    if (labels != nullptr && replaces) labels->counts[at] = {};
    if (labels != nullptr && block.has_labels) labels->counts[at].add(block.labels.counts[sample.at]);
  });
  finish(slot);
}

void BlockBlend::endWhatStands(const BlockIndex& index) {
  const std::uint32_t slot = volume_.find(index);
  if (slot == VoxelVolume::kNone || volume_.voxels(slot) == nullptr) return;
  VoxelBlock& to = volume_.changeVoxels(slot);
  std::size_t from = 0;
  Eigen::Vector3f rest;
  for (std::size_t at = 0; at < kBlockVoxels; ++at) {
    if (to.weight[at] == 0 || to.distance[at] >= 0 || !fallsIn(voxelOf(index, at), from, rest)) continue;
    if ((block_->free_parts & partBitAt(from)) != 0) to.weight[at] = 0;
  }
  finish(slot);
}

void BlockBlend::hint(const StoredBlock& block, const SE3& motion, const Eigen::Vector3f& vehicle) {
  place(block, motion);
  if (block.free_parts != 0) {
    forFree(box_, [&](const BlockIndex& index, const VoxelSet& free) {
      const std::uint64_t parts = wholeParts(free);
      if (parts != 0) volume_.hintFree(index, parts, vehicle);
    });
    return;
  }
  wanted_.clear();
  forBlocks(box_, [&](const BlockIndex& index) {
    if (wanted_.size() < wanted_.capacity() && reaches(index)) wanted_.push_back(index);
  });
  wanted_.resize(volume_.makeRoom(vehicle, wanted_));
  for (const BlockIndex& index : wanted_) {
    const std::uint32_t known = volume_.find(index);
    if (known != VoxelVolume::kNone && volume_.header(known).isWhollyFree()) continue;
    const std::uint32_t slot = volume_.obtain(index);
    if (slot == VoxelVolume::kNone) continue;
    VoxelBlock& to = volume_.changeVoxels(slot);
    bool any = false;
    fill(index, [&](std::size_t at, const Sample& sample) {
      if (to.weight[at] > 0) return;
      to.distance[at] = distanceOf(sample.distance);
      to.weight[at] = kHintWeight;
      to.grey[at] = block.voxels.grey[sample.at];
      any = true;
    });
    if (!any) continue;
    volume_.changeHeader(slot).hinted = true;
    finish(slot);
  }
}

}  // namespace swiftlet
