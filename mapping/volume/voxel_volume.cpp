#include "mapping/volume/voxel_volume.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace swiftlet {
namespace {

/// A full pool drops 1 / kEvictionShare of its blocks at once, so that not every image has to choose.
constexpr std::size_t kEvictionShare = 32;

}  // namespace

std::size_t VoxelVolume::blocksFor(std::size_t memory_bytes, bool labels) {
  constexpr std::size_t kHeaders = 1 + kFreePerBlock;
  const std::size_t each =
      sizeof(VoxelBlock) + (labels ? sizeof(LabelBlock) : 0) +
      kHeaders * (sizeof(BlockHeader) + sizeof(std::uint32_t) + sizeof(Farness) + sizeof(std::uint32_t)) +
      sizeof(std::uint32_t);
  std::size_t blocks = memory_bytes / each;
  const auto fits = [&](std::size_t n) {
    return n * each + BlockHash::bytesFor(n * kHeaders) <= memory_bytes;
  };
  while (blocks > 1 && !fits(blocks)) blocks -= std::max<std::size_t>(blocks / 64, 1);
  return std::max<std::size_t>(blocks, 1);
}

std::size_t VoxelVolume::bytesFor(std::size_t blocks, bool labels) {
  std::size_t bytes = blocks * sizeof(VoxelBlock);
  while (blocksFor(bytes, labels) < blocks) bytes += bytes / 8;
  return bytes;
}

VoxelVolume::VoxelVolume(const VolumeSettings& settings)
    : settings_(settings),
      hash_(blocksFor(settings.memory_bytes, settings.labels) * (1 + kFreePerBlock)),
      headers_(blocksFor(settings.memory_bytes, settings.labels) * (1 + kFreePerBlock)),
      blocks_(blocksFor(settings.memory_bytes, settings.labels)),
      labels_(settings.labels ? blocks_.size() : 0) {
  unused_headers_.reserve(headers_.size());
  unused_data_.reserve(blocks_.size());
  far_.resize(headers_.size());
  leaving_.resize(headers_.size());
  clear();
}

void VoxelVolume::clear() {
  hash_.clear();
  std::fill(headers_.begin(), headers_.end(), BlockHeader{});
  unused_headers_.clear();
  unused_data_.clear();
  // The lowest slots are given first.
  for (std::size_t i = headers_.size(); i-- > 0;) unused_headers_.push_back(static_cast<std::uint32_t>(i));
  for (std::size_t i = blocks_.size(); i-- > 0;) unused_data_.push_back(static_cast<std::uint32_t>(i));
  free_count_ = 0;
  ++revision_;
}

std::size_t VoxelVolume::bytes() const {
  return hash_.bytes() + headers_.size() * sizeof(BlockHeader) + blocks_.size() * sizeof(VoxelBlock) +
         labels_.size() * sizeof(LabelBlock) + far_.size() * sizeof(Farness) +
         (unused_headers_.capacity() + unused_data_.capacity() + leaving_.size()) * sizeof(std::uint32_t);
}

VoxelIndex VoxelVolume::voxelAt(const Eigen::Vector3d& p_world) const {
  const Eigen::Vector3d scaled = p_world / settings_.voxel_size;
  return {static_cast<std::int32_t>(std::floor(scaled.x())),
          static_cast<std::int32_t>(std::floor(scaled.y())),
          static_cast<std::int32_t>(std::floor(scaled.z()))};
}

Eigen::Vector3f VoxelVolume::centreOf(const BlockIndex& block) const {
  return blockSize() * (Eigen::Vector3f(static_cast<float>(block.x), static_cast<float>(block.y),
                                        static_cast<float>(block.z)) +
                        Eigen::Vector3f::Constant(0.5F));
}

bool VoxelVolume::distanceAt(const VoxelIndex& voxel, float& distance) const {
  const std::uint32_t slot = find(blockOf(voxel));
  if (slot == kNone) return false;
  const std::size_t at = offsetOf(voxel);
  if (headers_[slot].state == BlockState::kFree) {
    distance = static_cast<float>(settings_.truncation);
    return (headers_[slot].free_parts & partBitAt(at)) != 0;
  }
  const VoxelBlock& block = blocks_[headers_[slot].data];
  distance = distanceStep() * static_cast<float>(block.distance[at]);
  return block.weight[at] > 0;
}

bool VoxelVolume::addListener(BlockListener* listener) {
  if (listener_count_ == kMostListeners) return false;
  listeners_[listener_count_++] = listener;
  return true;
}

VoxelVolume::Farness VoxelVolume::farness(const BlockIndex& block, std::uint32_t slot,
                                          const Eigen::Vector3f& vehicle) const {
  return {(centreOf(block) - vehicle).squaredNorm(), keyOf(block), slot};
}

std::size_t VoxelVolume::makeRoom(const Eigen::Vector3f& vehicle, std::span<BlockIndex> wanted) {
  const auto isNew = [&](const BlockIndex& block) {
    const std::uint32_t slot = find(block);
    return slot == kNone || headers_[slot].state != BlockState::kVoxels;
  };
  const auto fresh = static_cast<std::size_t>(std::ranges::count_if(wanted, isNew));
  if (fresh <= unused_data_.size()) return wanted.size();
  std::size_t count = 0;
  for (std::uint32_t slot = 0; slot < headers_.size(); ++slot) {
    if (headers_[slot].state == BlockState::kVoxels)
      far_[count++] = farness(headers_[slot].index, slot, vehicle);
  }
  // New blocks for which the scratch has no room have the same limit; at worst obtain() refuses them.
  for (const BlockIndex& block : wanted) {
    if (isNew(block) && count < far_.size()) far_[count++] = farness(block, kNone, vehicle);
  }
  const std::size_t keep = blocks_.size() - std::min(blocks_.size() - 1, blocks_.size() / kEvictionShare);
  if (count <= keep) return wanted.size();
  std::nth_element(far_.begin(), far_.begin() + static_cast<std::ptrdiff_t>(keep),
                   far_.begin() + static_cast<std::ptrdiff_t>(count));
  const Farness limit = far_[keep];
  std::size_t leaving = 0;
  for (std::size_t i = keep; i < count; ++i) {
    if (far_[i].slot != kNone) leaving_[leaving++] = far_[i].slot;
  }
  std::sort(leaving_.begin(), leaving_.begin() + static_cast<std::ptrdiff_t>(leaving));
  const auto tooFar = [&](const BlockIndex& block) { return !(farness(block, kNone, vehicle) < limit); };
  counters_.refused += static_cast<std::size_t>(
      std::ranges::count_if(wanted, [&](const BlockIndex& block) { return isNew(block) && tooFar(block); }));
  counters_.evicted += leaving;
  remove({leaving_.data(), leaving});
  // Some wanted blocks were in the volume and have just been removed.
  std::size_t kept = 0;
  for (BlockIndex& block : wanted) {
    if (!isNew(block) || !tooFar(block)) std::swap(wanted[kept++], block);
  }
  return kept;
}

std::uint32_t VoxelVolume::newHeader(const BlockIndex& block) {
  if (!block.inRange()) {
    ++counters_.out_of_range;
    return kNone;
  }
  const std::uint32_t slot = unused_headers_.back();
  if (!hash_.insert(keyOf(block), slot)) {
    ++counters_.index_full;
    return kNone;
  }
  unused_headers_.pop_back();
  headers_[slot] = BlockHeader{};
  headers_[slot].index = block;
  headers_[slot].submap = submap_;
  headers_[slot].touched = submap_;
  return slot;
}

std::uint32_t VoxelVolume::obtain(const BlockIndex& block) {
  std::uint32_t slot = find(block);
  if (slot != kNone && headers_[slot].state == BlockState::kVoxels) return slot;
  if (unused_data_.empty()) {
    ++counters_.refused;
    return kNone;
  }
  if (slot == kNone) {
    slot = newHeader(block);
    if (slot == kNone) return kNone;
  } else {
    --free_count_;
  }
  BlockHeader& header = headers_[slot];
  const std::uint64_t free_parts = std::exchange(header.free_parts, 0);
  const auto weight = header.hinted ? kHintWeight : static_cast<std::uint16_t>(kWeightSteps);
  header.state = BlockState::kVoxels;
  header.data = unused_data_.back();
  header.sides = free_parts != 0 ? BlockHeader::kInFront : std::uint8_t{0};
  header.drift = 0;
  header.revision = revision_;
  unused_data_.pop_back();
  VoxelBlock& voxels = blocks_[header.data];
  voxels.distance.fill(static_cast<std::int16_t>(kDistanceSteps));
  // Free space is known by depth in front of a surface, which exceeds the distance: it counts as one
  // observation.
  for (std::size_t at = 0; at < kBlockVoxels; ++at)
    voxels.weight[at] = (free_parts & partBitAt(at)) != 0 ? weight : 0;
  voxels.grey.fill(0);
  if (!labels_.empty()) labels_[header.data].counts.fill(LabelCounts{});
  return slot;
}

std::uint32_t VoxelVolume::newFree(const BlockIndex& block, const Eigen::Vector3f& vehicle) {
  if (free_count_ == freeCapacity()) dropFarFree(vehicle);
  const std::uint32_t slot = newHeader(block);
  if (slot == kNone) return kNone;
  headers_[slot].state = BlockState::kFree;
  ++free_count_;
  return slot;
}

void VoxelVolume::addFree(const BlockIndex& block, std::uint64_t parts, const Eigen::Vector3f& vehicle) {
  std::uint32_t slot = find(block);
  if (slot == kNone) slot = newFree(block, vehicle);
  if (slot == kNone) return;
  BlockHeader& header = headers_[slot];
  if (std::exchange(header.hinted, false)) header.submap = submap_;
  // Free space is not in doubt only because it was seen long ago.
  if (outdated_ != nullptr && outdated_[header.submap] != 0) {
    for (std::size_t i = 0; i < listener_count_; ++i) listeners_[i]->beforeRenewal(*this, slot);
    header.free_parts = 0;
    header.submap = submap_;
  }
  header.touched = submap_;
  if ((parts & ~header.free_parts) == 0) return;
  header.free_parts |= parts;
  header.revision = revision_;
}

void VoxelVolume::hintFree(const BlockIndex& block, std::uint64_t parts, const Eigen::Vector3f& vehicle) {
  std::uint32_t slot = find(block);
  if (slot == kNone) {
    slot = newFree(block, vehicle);
    if (slot == kNone) return;
    headers_[slot].hinted = true;
  }
  BlockHeader& header = headers_[slot];
  if (header.state != BlockState::kFree || !header.hinted || (parts & ~header.free_parts) == 0) return;
  header.free_parts |= parts;
  header.revision = revision_;
}

void VoxelVolume::beginSubmap(SubmapId id, SubmapId stale_before, const std::uint8_t* outdated) {
  submap_ = id;
  stale_before_ = stale_before;
  outdated_ = outdated;
}

void VoxelVolume::renew(std::uint32_t slot) {
  if (headers_[slot].observed) {
    for (std::size_t i = 0; i < listener_count_; ++i) listeners_[i]->beforeRenewal(*this, slot);
  }
  BlockHeader& header = headers_[slot];
  header.submap = submap_;
  header.hinted = true;
  for (std::uint16_t& weight : blocks_[header.data].weight) weight = std::min(weight, kHintWeight);
  if (!labels_.empty()) labels_[header.data].counts.fill(LabelCounts{});
  markChanged(slot);
}

void VoxelVolume::copy(const VoxelVolume& from, std::uint32_t slot) {
  const BlockHeader& theirs = from.headers_[slot];
  if (theirs.state == BlockState::kFree) addFree(theirs.index, theirs.free_parts, {});
  if (theirs.state != BlockState::kVoxels) return;
  const std::uint32_t own = obtain(theirs.index);
  if (own == kNone) return;
  headers_[own].sides = theirs.sides;
  changeVoxels(own) = *from.voxels(slot);
  if (!labels_.empty() && !from.labels_.empty()) *changeLabels(own) = *from.labels(slot);
}

void VoxelVolume::dropFarFree(const Eigen::Vector3f& vehicle) {
  std::size_t count = 0;
  for (std::uint32_t slot = 0; slot < headers_.size(); ++slot) {
    if (headers_[slot].state == BlockState::kFree)
      far_[count++] = farness(headers_[slot].index, slot, vehicle);
  }
  const std::size_t keep = count - std::max<std::size_t>(count / kEvictionShare, 1);
  std::nth_element(far_.begin(), far_.begin() + static_cast<std::ptrdiff_t>(keep),
                   far_.begin() + static_cast<std::ptrdiff_t>(count));
  std::size_t leaving = 0;
  for (std::size_t i = keep; i < count; ++i) leaving_[leaving++] = far_[i].slot;
  std::sort(leaving_.begin(), leaving_.begin() + static_cast<std::ptrdiff_t>(leaving));
  counters_.evicted_free += leaving;
  remove({leaving_.data(), leaving});
}

void VoxelVolume::drop(std::uint32_t slot) {
  BlockHeader& header = headers_[slot];
  if (header.state == BlockState::kUnused) return;
  if (header.state == BlockState::kFree) --free_count_;
  if (header.state == BlockState::kVoxels) unused_data_.push_back(header.data);
  hash_.erase(keyOf(header.index));
  header = BlockHeader{};
  header.revision = revision_;
  unused_headers_.push_back(slot);
}

void VoxelVolume::remove(std::span<const std::uint32_t> slots) {
  if (slots.empty()) return;
  for (std::size_t i = 0; i < listener_count_; ++i) listeners_[i]->beforeRemoval(*this, slots);
  discard(slots);
}

void VoxelVolume::discard(std::span<const std::uint32_t> slots) {
  // A new revision: a slot that a reader has just read may be reused within this set of changes.
  ++revision_;
  for (const std::uint32_t slot : slots) drop(slot);
}

}  // namespace swiftlet
