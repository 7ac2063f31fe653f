#include "mapping/map/stored_blocks.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

/// Separate keys for free blocks and those with voxels, because an index may have both in different submaps.
/// The top bit of keyOf() is always set.
std::uint64_t placeKey(const BlockIndex& index, bool is_free) {
  return keyOf(index) ^ (is_free ? std::uint64_t{1} << 63U : 0);
}

/// A voxel is free up to the truncation distance if its distance is at least this share of it.
constexpr float kFreeShare = 0.98F;
/// A later voxel that contradicts replaces the earlier if it has at least this share of its weight.
/// Mismatches have less.
constexpr float kLaterCounts = 0.25F;
/// Weight [steps] with which the later counts, however often the earlier was seen: three images that saw all
/// of the block free (BlockUpdate::carve), or measurements whose mean has a sigma of 6 mm.
constexpr float kLaterIsSure = 3 * kWeightSteps;

/// Whether one is behind a surface and the other free up to the truncation distance.
bool contradict(float a, float b) {
  return (a < 0 && b >= kFreeShare * kDistanceSteps) || (b < 0 && a >= kFreeShare * kDistanceSteps);
}

}  // namespace

void StoredBlock::setLabels(const LabelBlock* seen) {
  has_labels = seen != nullptr &&
               !std::ranges::all_of(seen->counts, [](const auto& counts) { return counts.empty(); });
  if (has_labels) labels = *seen;
}

bool addVoxel(const VoxelBlock& from, std::size_t at, float distance, float most_weight, VoxelBlock& to,
              std::size_t to_at) {
  const float needed = std::min(kLaterCounts * static_cast<float>(to.weight[to_at]), kLaterIsSure);
  const bool replaces = static_cast<float>(from.weight[at]) >= needed && to.weight[to_at] > 0 &&
                        contradict(static_cast<float>(to.distance[to_at]), distance);
  if (replaces) {
    to.weight[to_at] = 0;
    to.grey[to_at] = 0;
  }
  const auto own = static_cast<float>(to.weight[to_at]), other = static_cast<float>(from.weight[at]);
  const float sum = own + other;
  to.distance[to_at] = distanceOf((own * static_cast<float>(to.distance[to_at]) + other * distance) / sum);
  to.weight[to_at] = static_cast<std::uint16_t>(std::min(sum, most_weight * kWeightSteps));
  // Free voxels have no grey value.
  const std::uint8_t grey = from.grey[at];
  if (grey > 0 && to.grey[to_at] > 0) {
    to.grey[to_at] = static_cast<std::uint8_t>(std::lround((own * to.grey[to_at] + other * grey) / sum));
  } else {
    to.grey[to_at] = std::max(to.grey[to_at], grey);
  }
  return replaces;
}

StoredBlocks::StoredBlocks(const VolumeSettings& settings, BlockStorage* storage, Agree agree)
    : most_weight_(static_cast<float>(settings.most_weight)),
      storage_(storage),
      agree_(std::move(agree)),
      newest_(storage != nullptr ? kMost : 1) {
  if (storage != nullptr) records_.reserve(kMost);
}

/// The newest record of this index and kind, if its submap agrees with `submap`; otherwise null.
StoredBlocks::Record* StoredBlocks::agreeing(const BlockIndex& index, SubmapId submap, bool is_free) {
  const std::uint32_t at = newest_.find(placeKey(index, is_free));
  if (at == BlockHash::kNone || !agree_(records_[at].submap, submap, index)) return nullptr;
  return &records_[at];
}

StoredBlocks::Record* StoredBlocks::add(const Record& record) {
  if (records_.size() == records_.capacity()) return nullptr;
  const std::uint64_t key = placeKey(record.index, record.is_free);
  static_cast<void>(newest_.erase(key));
  // If the table refuses the key, the next block of this index gets a record of its own.
  static_cast<void>(newest_.insert(key, static_cast<std::uint32_t>(records_.size())));
  records_.push_back(record);
  return &records_.back();
}

void StoredBlocks::putFree(const BlockIndex& index, SubmapId submap, std::uint64_t parts) {
  if (Record* const record = agreeing(index, submap, true); record != nullptr) {
    record->offset |= parts;
    record->submap = submap;
  } else if (add({index, submap, true, false, false, parts}) == nullptr) {
    ++lost_;
  }
}

bool StoredBlocks::gather(const VoxelVolume& volume, std::uint32_t slot, StoredBlock& out) {
  const BlockHeader& header = volume.header(slot);
  out.index = header.index;
  out.submap = header.submap;
  out.free_parts = header.state == BlockState::kFree && !header.hinted ? header.free_parts : 0;
  out.has_labels = false;
  const VoxelBlock* const voxels = volume.voxels(slot);
  if (voxels == nullptr || !header.observed) return out.free_parts != 0;
  out.voxels = *voxels;
  if (header.hinted) {
    for (std::uint16_t& weight : out.voxels.weight) weight = weight <= kHintWeight ? 0 : weight;
  }
  out.setLabels(volume.labels(slot));
  return true;
}

void StoredBlocks::put(const StoredBlock& block) {
  if (block.free_parts != 0) {
    putFree(block.index, block.submap, block.free_parts);
    return;
  }
  if (std::ranges::all_of(block.voxels.weight, [](std::uint16_t weight) { return weight == 0; })) return;
  Record* const earlier = agreeing(block.index, block.submap, false);
  if (earlier != nullptr && read(*earlier, merged_)) {
    lost_ += merge(*earlier, block) ? 0 : 1;
    return;
  }
  Record* const record = add({block.index, block.submap, false, block.has_labels, false, end_});
  if (record != nullptr && write(*record, block)) return;
  ++lost_;
  if (record == nullptr) return;
  static_cast<void>(newest_.erase(placeKey(block.index, false)));
  records_.pop_back();
}

/// Merges a block into merged_, which holds the content of `record`, and writes the result.
bool StoredBlocks::merge(Record& record, const StoredBlock& block) {
  if (!merged_.has_labels) merged_.labels.counts.fill({});
  merged_.has_labels = merged_.has_labels || block.has_labels;
  for (std::size_t at = 0; at < kBlockVoxels; ++at) {
    if (block.voxels.weight[at] == 0) continue;
    if (addVoxel(block.voxels, at, static_cast<float>(block.voxels.distance[at]), most_weight_,
                 merged_.voxels, at)) {
      merged_.labels.counts[at] = {};
    }
    if (block.has_labels) merged_.labels.counts[at].add(block.labels.counts[at]);
  }
  Record next = record;
  // The merged block was last seen in the later submap.
  next.submap = block.submap;
  if (next.has_labels != merged_.has_labels) {
    // With labels it no longer fits at its offset.
    next.has_labels = merged_.has_labels;
    next.offset = end_;
  }
  if (!write(next, merged_)) return false;
  record = next;
  return true;
}

bool StoredBlocks::write(const Record& record, const StoredBlock& block) {
  const std::uint64_t labels_at = record.offset + sizeof(VoxelBlock);
  if (!storage_->write(record.offset, std::as_bytes(std::span(&block.voxels, 1)))) return false;
  if (record.has_labels && !storage_->write(labels_at, std::as_bytes(std::span(&block.labels, 1))))
    return false;
  end_ = std::max(end_, labels_at + (record.has_labels ? sizeof(LabelBlock) : 0));
  return true;
}

bool StoredBlocks::read(const Record& record, StoredBlock& out) {
  out.index = record.index;
  out.submap = record.submap;
  out.has_labels = record.has_labels;
  out.free_parts = record.is_free ? record.offset : 0;
  if (record.is_free) return true;
  const bool done = storage_->read(record.offset, std::as_writable_bytes(std::span(&out.voxels, 1))) &&
                    (!record.has_labels || storage_->read(record.offset + sizeof(VoxelBlock),
                                                          std::as_writable_bytes(std::span(&out.labels, 1))));
  reads_failed_ += done ? 0 : 1;
  return done;
}

}  // namespace swiftlet
