#pragma once
// Blocks that left the volume, or began anew in it: every submap's share of the map, on disk, found by
// number.
//
// A record in memory tells which block of which submap lies where in the storage. One place has as many as it
// was seen in submaps far apart in time; whoever reads lays one over the other (block_blend.hpp). What was
// seen free without voxels is a record alone. Memory: 24 bytes a block and two blocks of scratch, reserved at
// construction. Cost: a copy of 2.5 kB, 6.6 kB with labels, to or from the storage. Errors: a block that the
// storage does not take, or that finds no record, is lost, counted. Not thread safe.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

/// Bytes that are not memory's: a file. Of the thread that maps.
class BlockStorage {
 public:
  virtual ~BlockStorage() = default;
  /// Over what was written there before, or behind it. False: nothing of it can be read again.
  virtual bool write(std::uint64_t offset, std::span<const std::byte> bytes) = 0;
  virtual bool read(std::uint64_t offset, std::span<std::byte> bytes) = 0;
};

struct StoredBlock {
  BlockIndex index;
  SubmapId submap = 0;
  std::uint64_t free_parts = 0;  ///< of a block without voxels; else 0
  bool has_labels = false;
  VoxelBlock voxels;
  LabelBlock labels;

  /// Null, or without any label: it has none.
  void setLabels(const LabelBlock* seen);
};

/// A later voxel of `from`, with this distance [steps], into one of `to`: averages by weight. True where it
/// took its place: the one says behind a surface and the other free up to the truncation distance, so
/// something has come or gone, and the later counts unless it has far less weight.
bool addVoxel(const VoxelBlock& from, std::size_t at, float distance, float most_weight, VoxelBlock& to,
              std::size_t to_at);

class StoredBlocks {
 public:
  struct Record {
    BlockIndex index;
    SubmapId submap = 0;
    bool is_free : 1 = false;
    bool has_labels : 1 = false;
    bool shown : 1 = false;    ///< laid into the volume, for whoever does
    std::uint64_t offset = 0;  ///< in the storage; of a free block its parts
  };
  /// A map of some 2 000 m^2 seen once, and what is free around it.
  static constexpr std::size_t kMost = std::size_t{1} << 19U;

  /// Whether the blocks of two submaps lie to each other as they were fused, so that one may go into the
  /// other.
  using Agree = std::function<bool(SubmapId, SubmapId, const BlockIndex&)>;

  /// `storage` may be null: every block is lost. It outlives the use.
  StoredBlocks(const VolumeSettings& settings, BlockStorage* storage, Agree agree);

  /// What images showed of the slot's block, without hints; false where that is nothing.
  static bool gather(const VoxelVolume& volume, std::uint32_t slot, StoredBlock& out);
  /// Into the newest record of the place where both agree: a place that is seen again and again takes no more
  /// room.
  void put(const StoredBlock& block);
  void put(const VoxelVolume& volume, std::uint32_t slot) {
    if (gather(volume, slot, scratch_)) put(scratch_);
  }
  /// False where it cannot be read.
  bool read(std::size_t i, StoredBlock& out) { return read(records_[i], out); }

  [[nodiscard]] std::size_t size() const { return records_.size(); }
  [[nodiscard]] const Record& operator[](std::size_t i) const { return records_[i]; }
  void setShown(std::size_t i, bool shown) { records_[i].shown = shown; }
  [[nodiscard]] std::uint64_t lost() const { return lost_; }
  [[nodiscard]] std::uint64_t bytesStored() const { return end_; }
  [[nodiscard]] std::size_t bytes() const {
    return sizeof(*this) + records_.capacity() * sizeof(Record) + newest_.bytes();
  }

 private:
  [[nodiscard]] Record* agreeing(const BlockIndex& index, SubmapId submap, bool is_free);
  Record* add(const Record& record);
  void putFree(const BlockIndex& index, SubmapId submap, std::uint64_t parts);
  bool merge(Record& record, const StoredBlock& block);
  bool write(Record& record, const StoredBlock& block);
  [[nodiscard]] bool read(const Record& record, StoredBlock& out);

  float most_weight_;
  BlockStorage* storage_;
  Agree agree_;
  BlockHash newest_;  ///< record of each place
  std::vector<Record> records_;
  std::uint64_t end_ = 0;
  std::uint64_t lost_ = 0;
  StoredBlock scratch_, merged_;
};

}  // namespace swiftlet
