#pragma once
// The volume: blocks of voxels around surfaces, and blocks known to be free, in memory fixed at construction.
//
// World axes (of whoever gives the poses), metres. A block is in one of two states: kVoxels, with data from
// the block pool; kFree, without data, of which some parts were seen free and nothing is known of the others.
// What is not in the volume is unknown.
//
// A block belongs to the submap in which it became known: its images moved as one since, where loops moved
// them (mapping/map/submaps.hpp). touch() comes before every image that changes it.
//
// For readers (surface, distance field): slots 0 to slots() - 1 in order are every block, in an order that
// only the history decides; revision(slot) tells each reader by itself what has changed since it last looked;
// a BlockListener hears of blocks before they are dropped. Readers hold no references across updates.
//
// When it is full, the blocks farthest from the vehicle go (evict); a new block that would itself lie
// farthest is refused. Both are counted. Memory: VolumeSettings::memory_bytes, all of it reserved and
// written to by the constructor; nothing is allocated later. Not thread safe.

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
  std::uint32_t data = BlockHash::kNone;  ///< in the pool, for kVoxels
  std::uint32_t revision = 0;             ///< the volume's at the last change
  SubmapId submap = 0;                    ///< of its first image
  SubmapId touched = 0;                   ///< of its last
  std::uint64_t free_parts = 0;           ///< for kFree: never 0
  BlockState state = BlockState::kUnused;
  /// For kVoxels: kInFront and kBehind, where any observed voxel is on that side of a surface. A surface
  /// passes between voxels of both sides only.
  std::uint8_t sides = 0;
  bool observed = false;  ///< an image changed it since it became known or began anew
  /// It holds voxels of kHintWeight that are not of its own images; for kFree: all of it is known so.
  bool hinted = false;
  /// Largest change of a distance since the last that counted as one [steps], summed.
  float drift = 0;

  static constexpr std::uint8_t kInFront = 1;
  static constexpr std::uint8_t kBehind = 2;

  [[nodiscard]] bool isWhollyFree() const { return free_parts == kAllParts; }
  /// No image has seen it.
  [[nodiscard]] bool isHint() const {
    return hinted && (state == BlockState::kFree || (state == BlockState::kVoxels && !observed));
  }
};

class VoxelVolume;

/// Who wants to see blocks before they are dropped or begin anew: the volume is whole when it is called.
class BlockListener {
 public:
  virtual ~BlockListener() = default;
  virtual void beforeRemoval(const VoxelVolume& volume, std::span<const std::uint32_t> slots) = 0;
  /// The block begins anew (VoxelVolume::touch).
  virtual void beforeRenewal(const VoxelVolume& volume, std::uint32_t slot) = 0;
};

struct VolumeCounters {
  std::uint64_t evicted = 0;       ///< blocks with voxels, dropped for nearer ones
  std::uint64_t evicted_free = 0;  ///< free blocks, likewise
  std::uint64_t refused = 0;       ///< new blocks for which nothing farther could go
  std::uint64_t out_of_range = 0;  ///< new blocks beyond kBlockLimit
  std::uint64_t index_full = 0;    ///< new blocks for which the index had no place nearby
};

class VoxelVolume {
 public:
  static constexpr std::uint32_t kNone = BlockHash::kNone;
  static constexpr std::size_t kMostListeners = 4;
  /// Free blocks that can be known for each block with voxels.
  static constexpr std::size_t kFreePerBlock = 2;

  explicit VoxelVolume(const VolumeSettings& settings);

  [[nodiscard]] const VolumeSettings& settings() const { return settings_; }
  [[nodiscard]] float voxelSize() const { return static_cast<float>(settings_.voxel_size); }
  [[nodiscard]] float blockSize() const { return voxelSize() * kBlockSide; }

  // ---- reading ----

  [[nodiscard]] std::uint32_t slots() const { return static_cast<std::uint32_t>(headers_.size()); }
  [[nodiscard]] const BlockHeader& header(std::uint32_t slot) const { return headers_[slot]; }
  [[nodiscard]] std::uint32_t revision(std::uint32_t slot) const { return headers_[slot].revision; }
  /// Of the newest change.
  [[nodiscard]] std::uint32_t revision() const { return revision_; }
  /// kNone where the block is unknown.
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
  /// Metres for one step of VoxelBlock::distance.
  [[nodiscard]] float distanceStep() const {
    return static_cast<float>(settings_.truncation) / kDistanceSteps;
  }
  /// Signed distance [m] at a voxel, cut at the truncation distance; false where nothing was observed.
  [[nodiscard]] bool distanceAt(const VoxelIndex& voxel, float& distance) const;
  [[nodiscard]] VoxelIndex voxelAt(const Eigen::Vector3d& p_world) const;
  [[nodiscard]] Eigen::Vector3f centreOf(const BlockIndex& block) const;

  [[nodiscard]] std::size_t blockCapacity() const { return blocks_.size(); }
  [[nodiscard]] std::size_t blockCount() const { return blocks_.size() - unused_data_.size(); }
  [[nodiscard]] std::size_t freeCount() const { return free_count_; }
  [[nodiscard]] std::size_t freeCapacity() const { return headers_.size() - blocks_.size(); }
  /// Reserved at construction.
  [[nodiscard]] std::size_t bytes() const;
  /// Of `memory_bytes`, how many blocks with voxels it makes.
  static std::size_t blocksFor(std::size_t memory_bytes, bool labels);
  /// Memory that makes at least so many.
  static std::size_t bytesFor(std::size_t blocks, bool labels);
  [[nodiscard]] const VolumeCounters& counters() const { return counters_; }

  // ---- changing ----

  /// At most kMostListeners, which outlive the volume's use; false beyond.
  bool addListener(BlockListener* listener);

  /// Blocks that become known from now on are of submap `id`. Those touched last in a submap before
  /// `stale_before`, or of one that is `outdated` (by id; may be null, outlives the volume's use), begin anew
  /// when they are touched; free blocks in the second case alone.
  void beginSubmap(SubmapId id, SubmapId stale_before, const std::uint8_t* outdated);
  /// An image is about to change a block with voxels. Where it begins anew the listeners see it
  /// before, and what it held stays as a hint: with the least weight, for as long as nothing newer is known.
  void touch(std::uint32_t slot) {
    BlockHeader& header = headers_[slot];
    if (isOutdated(header)) renew(slot);
    header.touched = submap_;
    header.observed = true;
  }

  /// Begins a set of changes and gives its revision.
  std::uint32_t beginChange() { return ++revision_; }
  void markChanged(std::uint32_t slot) {
    headers_[slot].revision = revision_;
    headers_[slot].drift = 0;
  }

  /// Makes room for the new ones with voxels among `wanted` beside what stays, farthest from `vehicle` first:
  /// drops blocks, and moves those of `wanted` that are refused behind the others, which keep their order.
  /// How many these are. Slots may change hands.
  std::size_t makeRoom(const Eigen::Vector3f& vehicle, std::span<BlockIndex> wanted);
  /// The slot of a block with voxels: the one there is, else a new one, its voxels unobserved (or free,
  /// by one observation, where they were seen free). kNone when full: makeRoom() first.
  std::uint32_t obtain(const BlockIndex& block);
  /// These parts of the block, which has no voxels, were seen free. A full table drops the farthest.
  void addFree(const BlockIndex& block, std::uint64_t parts, const Eigen::Vector3f& vehicle);
  /// Parts known from elsewhere to be free. Taken where no image has seen the block; not stored again.
  void hintFree(const BlockIndex& block, std::uint64_t parts, const Eigen::Vector3f& vehicle);

  /// A block of another volume, which is not here yet: as it is there.
  void copy(const VoxelVolume& from, std::uint32_t slot);

  /// Drops blocks after the listeners have seen them.
  void remove(std::span<const std::uint32_t> slots);
  /// The same for blocks that turned out wrong: listeners are not asked.
  void discard(std::span<const std::uint32_t> slots);
  /// Everything unknown again; listeners are not asked.
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

    /// Nearer first; ties by the key, so that the order is the blocks' alone.
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
