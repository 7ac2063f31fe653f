#pragma once
// Blends a block that has moved since it was fused into a volume at its new pose.
//
// A voxel of the volume whose centre falls into a voxel of the moved block takes that voxel's distance,
// extrapolated to the centre by its gradient. Distances and grey values average by weight, as if the images
// of both had been fused into one block, and label counts add up. If surface appeared or disappeared, the
// later of the two wins (addVoxel()). The block needs no neighbours, and the band around a surface keeps its
// thickness. The extrapolation is of first order: at a surface of radius r half a voxel costs
// (voxel / 2)^2 / 2 r, 3 mm at 10 cm. A block that has not moved is copied bit by bit. If the volume is full,
// VoxelVolume::makeRoom decides what is dropped. Cost: 15 to 40 us a block.

#include <bitset>
#include <cstdint>
#include <vector>

#include "estimator/geometry/se3.hpp"
#include "mapping/map/stored_blocks.hpp"
#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

/// A box of blocks, from `low` to `high` inclusive.
struct BlockRange {
  BlockIndex low;
  BlockIndex high;

  [[nodiscard]] bool holds(const BlockIndex& b) const {
    return b.x >= low.x && b.x <= high.x && b.y >= low.y && b.y <= high.y && b.z >= low.z && b.z <= high.z;
  }
};

class BlockBlend {
 public:
  explicit BlockBlend(VoxelVolume& volume);

  /// Blends into blocks of `within` for which there is room (VoxelVolume::obtain). A free block only removes
  /// surface in its free parts.
  void add(const StoredBlock& block, const SE3& motion, const BlockRange& within);
  /// After all calls of add(): combines the free parts of blocks where no voxel is known. A part is free if
  /// the centres of all its voxels fall into free parts of any of the blocks.
  void beginFree(const BlockRange& within);
  void addFree(const StoredBlock& block, const SE3& motion);
  void endFree();
  /// Fills only unknown voxels, with kHintWeight. If the volume is full, blocks farther from `vehicle` than
  /// all others are left out. A free block fills only blocks that no image has seen.
  void hint(const StoredBlock& block, const SE3& motion, const Eigen::Vector3f& vehicle);

 private:
  /// The voxel of the moved block that the centre of a voxel of the volume falls into.
  struct Sample {
    std::size_t at = 0;  ///< index in the moved block
    float distance = 0;  ///< extrapolated to the centre [steps]
  };

  using VoxelSet = std::bitset<kBlockVoxels>;

  void place(const StoredBlock& block, const SE3& motion);
  template <typename Take>
  void forFree(const BlockRange& within, const Take& take) const;
  template <typename Take>
  void fill(const BlockIndex& to, const Take& take) const;
  [[nodiscard]] bool reaches(const BlockIndex& to) const;
  /// False if the centre of `voxel` is outside the moved block; `at`: the voxel that it falls into.
  [[nodiscard]] bool fallsIn(const VoxelIndex& voxel, std::size_t& at, Eigen::Vector3f& rest) const;
  void addVoxels(const BlockIndex& to);
  void endWhatStands(const BlockIndex& to);
  void fillFree(std::uint32_t slot, std::uint64_t parts);
  void finish(std::uint32_t slot);

  VoxelVolume& volume_;
  const StoredBlock* block_ = nullptr;
  BlockRange box_;            ///< blocks that the moved one touches
  Eigen::Matrix3d to_block_;  ///< from voxel indices of the volume to those of the moved block
  Eigen::Vector3d at_block_;
  std::vector<BlockIndex> wanted_;  ///< scratch
  BlockRange free_range_;
  std::vector<VoxelSet> free_;  ///< of each block in free_range_, x fastest
};

}  // namespace swiftlet
