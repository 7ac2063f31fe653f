#pragma once
// Blocks that left the volume or began anew in it, on disk: the share of each submap in the map.
//
// A record in memory tells where a block of a submap is in the storage. A block has several records if
// submaps far apart in time saw it; readers overlay them (block_blend.hpp). A free block without voxels is
// only a record. Memory: 56 bytes a record, of which 32 for the index, and two blocks of scratch, reserved at
// construction. Cost: a copy of 2.5 kB, 6.6 kB with labels, to or from the storage. Errors: a block that the
// storage refuses, or for which no record is left, is lost and counted; reads that fail are counted. Not
// thread safe.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

/// Storage outside memory, such as a file. Used only by the thread that maps.
class BlockStorage {
 public:
  virtual ~BlockStorage() = default;
  /// Overwrites earlier bytes or appends. False: none of these bytes can be read again.
  virtual bool write(std::uint64_t offset, std::span<const std::byte> bytes) = 0;
  virtual bool read(std::uint64_t offset, std::span<std::byte> bytes) = 0;
};

struct StoredBlock {
  BlockIndex index;
  SubmapId submap = 0;
  std::uint64_t free_parts = 0;  ///< of a block without voxels; otherwise 0
  bool has_labels = false;
  VoxelBlock voxels;
  LabelBlock labels;

  /// Null, or counts without any label: the block has no labels.
  void setLabels(const LabelBlock* seen);
};

/// Adds a later voxel of `from`, with this distance [steps], to one of `to`; averages by weight. True if the
/// later voxel replaced the earlier: one is behind a surface and the other free up to the truncation
/// distance, so the scene changed. The later one wins if it is sure or has a quarter of the earlier weight.
bool addVoxel(const VoxelBlock& from, std::size_t at, float distance, float most_weight, VoxelBlock& to,
              std::size_t to_at);

class StoredBlocks {
 public:
  struct Record {
    BlockIndex index;
    SubmapId submap = 0;
    bool is_free : 1 = false;
    bool has_labels : 1 = false;
    bool shown : 1 = false;    ///< in the volume as a hint; set by the caller
    std::uint64_t offset = 0;  ///< in the storage; for a free block its free parts
  };
  /// A map of some 2000 m^2 seen once, with the free space around it.
  static constexpr std::size_t kMost = std::size_t{1} << 19U;

  /// Whether two submaps have not moved relative to each other since they were fused, so that their blocks
  /// may be merged.
  using Agree = std::function<bool(SubmapId, SubmapId, const BlockIndex&)>;

  /// `storage` must outlive this object. Null: every block is lost.
  StoredBlocks(const VolumeSettings& settings, BlockStorage* storage, Agree agree);

  /// The content of the slot's block without hints; false if there is none.
  static bool gather(const VoxelVolume& volume, std::uint32_t slot, StoredBlock& out);
  /// Merges into the newest record of the block if both agree, so that a place seen repeatedly takes no more
  /// room; otherwise adds a record.
  void put(const StoredBlock& block);
  void put(const VoxelVolume& volume, std::uint32_t slot) {
    if (gather(volume, slot, scratch_)) put(scratch_);
  }
  /// False if it cannot be read.
  bool read(std::size_t i, StoredBlock& out) { return read(records_[i], out); }

  [[nodiscard]] std::size_t size() const { return records_.size(); }
  [[nodiscard]] const Record& operator[](std::size_t i) const { return records_[i]; }
  void setShown(std::size_t i, bool shown) { records_[i].shown = shown; }
  [[nodiscard]] std::uint64_t lost() const { return lost_; }
  /// Reads that the storage failed: the blocks are missing from what they were read for.
  [[nodiscard]] std::uint64_t readsFailed() const { return reads_failed_; }
  [[nodiscard]] std::uint64_t bytesStored() const { return end_; }
  [[nodiscard]] std::size_t bytes() const {
    return sizeof(*this) + records_.capacity() * sizeof(Record) + newest_.bytes();
  }

 private:
  [[nodiscard]] Record* agreeing(const BlockIndex& index, SubmapId submap, bool is_free);
  Record* add(const Record& record);
  void putFree(const BlockIndex& index, SubmapId submap, std::uint64_t parts);
  bool merge(Record& record, const StoredBlock& block);
  bool write(const Record& record, const StoredBlock& block);
  [[nodiscard]] bool read(const Record& record, StoredBlock& out);

  float most_weight_;
  BlockStorage* storage_;
  Agree agree_;
  BlockHash newest_;  ///< newest record of each block index
  std::vector<Record> records_;
  std::uint64_t end_ = 0;
  std::uint64_t lost_ = 0;
  std::uint64_t reads_failed_ = 0;
  StoredBlock scratch_, merged_;
};

}  // namespace swiftlet
