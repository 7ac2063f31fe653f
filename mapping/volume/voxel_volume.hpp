#pragma once
// The volume: blocks of voxels around surfaces, and free blocks, in memory fixed at construction.
//
// World axes (those of the given poses), metres. A block has one of two states. kVoxels: it has data in the
// block pool. kFree: it has no data; some of its parts were seen free, the others are unknown. A block that
// is not in the volume is unknown.
//
// A block belongs to the submap in which it became known, whose images move rigidly when loops move them
// (mapping/map/submaps.hpp). Call beginImage() before and touch() after every image that changes a block.
//
// For readers (surface, distance field): slots 0 to slots() - 1 hold all blocks, in an order that depends on
// the history. revision(slot) lets each reader find independently what changed since it last looked. A
// BlockListener is called before blocks are dropped. Readers must not hold references across updates.
//
// When the volume is full, the blocks farthest from the vehicle are dropped; a new block that would itself be
// farthest is refused. Both are counted. Memory: VolumeSettings::memory_bytes, reserved and written to by the
// constructor; nothing is allocated later. Not thread safe.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "estimator/core/status.hpp"
#include "mapping/volume/block_hash.hpp"
#include "mapping/volume/block_index.hpp"
#include "mapping/volume/volume_settings.hpp"
#include "mapping/volume/voxel_block.hpp"

namespace swiftlet {

enum class BlockState : std::uint8_t { kUnused, kFree, kVoxels };

struct BlockHeader {
  BlockIndex index;
  std::uint32_t data = BlockHash::kNone;  ///< index in the pool, for kVoxels
  std::uint32_t revision = 0;             ///< the volume's revision at the last change
  SubmapId submap = 0;                    ///< of its first image
  SubmapId touched = 0;                   ///< of its last image
  std::uint64_t free_parts = 0;           ///< for kFree: never 0
  BlockState state = BlockState::kUnused;
  /// For kVoxels: kInFront and kBehind, set if any observed voxel is on that side of a surface. A surface
  /// passes only through blocks with both.
  std::uint8_t sides = 0;
  bool observed = false;  ///< an image changed it since it became known or began anew
  /// Has voxels of kHintWeight that are not from its own images; for kFree: all of it is a hint.
  bool hinted = false;
  /// Sum of the largest changes of a distance since the block last counted as changed [steps].
  float drift = 0;

  static constexpr std::uint8_t kInFront = 1;
  static constexpr std::uint8_t kBehind = 2;

  [[nodiscard]] bool isWhollyFree() const { return free_parts == kAllParts; }
  /// Whether no image has seen the block.
  [[nodiscard]] bool isHint() const {
    return hinted && (state == BlockState::kFree || (state == BlockState::kVoxels && !observed));
  }
};

class VoxelVolume;

/// Called before blocks are dropped or begin anew; the volume is then still complete.
class BlockListener {
 public:
  virtual ~BlockListener() = default;
  virtual void beforeRemoval(const VoxelVolume& volume, std::span<const std::uint32_t> slots) = 0;
  /// The block begins anew (VoxelVolume::touch).
  virtual void beforeRenewal(const VoxelVolume& volume, std::uint32_t slot) = 0;
};

struct VolumeCounters {
  std::uint64_t evicted = 0;       ///< blocks with voxels dropped for nearer ones
  std::uint64_t evicted_free = 0;  ///< free blocks dropped for nearer ones
  std::uint64_t refused = 0;       ///< new blocks refused because none was farther
  std::uint64_t out_of_range = 0;  ///< new blocks beyond kBlockLimit
  std::uint64_t index_full = 0;    ///< new blocks refused by the index (BlockHash::kMostProbes)
};

class VoxelVolume {
 public:
  static constexpr std::uint32_t kNone = BlockHash::kNone;
  static constexpr std::size_t kMostListeners = 4;
  /// Capacity for free blocks per block with voxels.
  static constexpr std::size_t kFreePerBlock = 2;

  explicit VoxelVolume(const VolumeSettings& settings);

  [[nodiscard]] const VolumeSettings& settings() const { return settings_; }
  [[nodiscard]] float voxelSize() const { return static_cast<float>(settings_.voxel_size); }
  [[nodiscard]] float blockSize() const { return voxelSize() * kBlockSide; }

  // ---- reading ----

  [[nodiscard]] std::uint32_t slots() const { return static_cast<std::uint32_t>(headers_.size()); }
  [[nodiscard]] const BlockHeader& header(std::uint32_t slot) const { return headers_[slot]; }
  [[nodiscard]] std::uint32_t revision(std::uint32_t slot) const { return headers_[slot].revision; }
  /// Revision of the newest change.
  [[nodiscard]] std::uint32_t revision() const { return revision_; }
  /// kNone if the block is unknown.
  [[nodiscard]] std::uint32_t find(const BlockIndex& block) const { return hash_.find(keyOf(block)); }
  /// Null unless the slot is kVoxels.
  [[nodiscard]] const VoxelBlock* voxels(std::uint32_t slot) const {
    return headers_[slot].state == BlockState::kVoxels ? &blocks_[headers_[slot].data] : nullptr;
  }
  /// Null without labels.
  [[nodiscard]] const LabelBlock* labels(std::uint32_t slot) const {
    const BlockHeader& h = headers_[slot];
    return h.state == BlockState::kVoxels && !labels_.empty() ? &labels_[h.data] : nullptr;
  }
  /// Metres per step of VoxelBlock::distance.
  [[nodiscard]] float distanceStep() const {
    return static_cast<float>(settings_.truncation) / kDistanceSteps;
  }
  /// Signed distance [m] at a voxel, cut at the truncation distance; false if the voxel was not observed.
  [[nodiscard]] bool distanceAt(const VoxelIndex& voxel, float& distance) const;
  [[nodiscard]] VoxelIndex voxelAt(const Eigen::Vector3d& p_world) const;
  [[nodiscard]] Eigen::Vector3f centreOf(const BlockIndex& block) const;

  [[nodiscard]] std::size_t blockCapacity() const { return blocks_.size(); }
  [[nodiscard]] std::size_t blockCount() const { return blocks_.size() - unused_data_.size(); }
  [[nodiscard]] std::size_t freeCount() const { return free_count_; }
  [[nodiscard]] std::size_t freeCapacity() const { return headers_.size() - blocks_.size(); }
  /// Memory reserved at construction.
  [[nodiscard]] std::size_t bytes() const;
  /// Number of blocks with voxels that fit into `memory_bytes`.
  static std::size_t blocksFor(std::size_t memory_bytes, bool labels);
  /// Memory for at least `blocks` blocks with voxels.
  static std::size_t bytesFor(std::size_t blocks, bool labels);
  [[nodiscard]] const VolumeCounters& counters() const { return counters_; }

  // ---- changing ----

  /// At most kMostListeners, which must outlive the volume; false beyond.
  bool addListener(BlockListener* listener);

  /// Blocks that become known from now on belong to submap `id`. Blocks last touched in a submap before
  /// `stale_before`, or of an `outdated` submap, begin anew when they are touched; free blocks only in the
  /// second case. `outdated`: by id; may be null, must outlive the volume.
  void beginSubmap(SubmapId id, SubmapId stale_before, const std::uint8_t* outdated);
  /// Call before an image changes a block with voxels. If the block begins anew, the listeners are called
  /// first, and its content stays as a hint with the least weight until something newer is known.
  void beginImage(std::uint32_t slot) {
    if (isOutdated(headers_[slot])) renew(slot);
  }
  /// Call after an image has changed the block.
  void touch(std::uint32_t slot) {
    headers_[slot].touched = submap_;
    headers_[slot].observed = true;
  }

  /// Begins a set of changes and returns its revision.
  std::uint32_t beginChange() { return ++revision_; }
  void markChanged(std::uint32_t slot) {
    headers_[slot].revision = revision_;
    headers_[slot].drift = 0;
  }

  /// Makes room for the blocks of `wanted` that are new: drops those farthest from `vehicle`, or refuses
  /// wanted ones that are farther. Moves refused blocks to the end of `wanted`; the others keep their order.
  /// Returns the number of the others. Slots may be reused.
  std::size_t makeRoom(const Eigen::Vector3f& vehicle, std::span<BlockIndex> wanted);
  /// The slot of a block with voxels, existing or new. Voxels of a new block are unobserved, or free by one
  /// observation if they were seen free. kNone if full: call makeRoom() first.
  std::uint32_t obtain(const BlockIndex& block);
  /// Marks parts of a block without voxels as seen free. A full table drops the farthest block.
  void addFree(const BlockIndex& block, std::uint64_t parts, const Eigen::Vector3f& vehicle);
  /// Marks parts as free by a hint, if no image has seen the block. Hints are not stored again.
  void hintFree(const BlockIndex& block, std::uint64_t parts, const Eigen::Vector3f& vehicle);

  /// Copies a block of another volume, which must not exist here.
  void copy(const VoxelVolume& from, std::uint32_t slot);

  /// Drops blocks after calling the listeners.
  void remove(std::span<const std::uint32_t> slots);
  /// Drops wrong blocks without calling the listeners.
  void discard(std::span<const std::uint32_t> slots);
  /// Makes everything unknown without calling the listeners.
  void clear();

  [[nodiscard]] VoxelBlock& changeVoxels(std::uint32_t slot) { return blocks_[headers_[slot].data]; }
  [[nodiscard]] LabelBlock* changeLabels(std::uint32_t slot) {
    return labels_.empty() ? nullptr : &labels_[headers_[slot].data];
  }
  [[nodiscard]] BlockHeader& changeHeader(std::uint32_t slot) { return headers_[slot]; }

 private:
  struct Farness {
    float squared = 0;  ///< of the block's centre from the vehicle
    std::uint64_t key = 0;
    std::uint32_t slot = 0;  ///< kNone: a wanted block

    /// Nearer first; ties by key, so that the order depends only on the blocks.
    bool operator<(const Farness& o) const {
      return squared != o.squared ? squared < o.squared : key < o.key;
    }
  };

  [[nodiscard]] Farness farness(const BlockIndex& block, std::uint32_t slot,
                                const Eigen::Vector3f& vehicle) const;
  std::uint32_t newHeader(const BlockIndex& block);
  [[nodiscard]] bool isOutdated(const BlockHeader& header) const {
    return header.touched < stale_before_ || (outdated_ != nullptr && outdated_[header.submap] != 0);
  }
  std::uint32_t newFree(const BlockIndex& block, const Eigen::Vector3f& vehicle);
  void renew(std::uint32_t slot);
  void drop(std::uint32_t slot);
  void dropFarFree(const Eigen::Vector3f& vehicle);

  VolumeSettings settings_;
  BlockHash hash_;
  std::vector<BlockHeader> headers_;
  std::vector<VoxelBlock> blocks_;
  std::vector<LabelBlock> labels_;
  std::vector<std::uint32_t> unused_headers_;  ///< stacks
  std::vector<std::uint32_t> unused_data_;
  std::vector<Farness> far_;  ///< scratch
  std::vector<std::uint32_t> leaving_;
  std::size_t free_count_ = 0;
  std::uint32_t revision_ = 0;
  SubmapId submap_ = 0;
  SubmapId stale_before_ = 0;
  const std::uint8_t* outdated_ = nullptr;
  std::array<BlockListener*, kMostListeners> listeners_{};
  std::size_t listener_count_ = 0;
  VolumeCounters counters_;
};

}  // namespace swiftlet
