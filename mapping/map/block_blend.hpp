#pragma once
// Lays a block that has moved since it was fused over what a volume has at its new place.
//
// A voxel of the volume whose centre falls into a voxel of the moved block takes that one's distance, carried
// over the rest of the way by its gradient, with its weight: distances average by weight, as if the images of
// both had been fused into one block; grey values likewise, label counts add up; what has come or gone is as
// the later of the two has it (addVoxel()). The block needs no neighbour, and the band around a surface stays
// as thick as it was. First order: where a surface bends by a radius r, half a voxel of way costs
// (voxel / 2)^2 / 2 r: 3 mm at 10 cm. A block that has not moved is taken bit by bit. Where memory ends the
// volume's rule tells who goes (VoxelVolume::makeRoom). Cost: 15 to 40 us a block.

#include <bitset>
#include <cstdint>
#include <vector>

#include "estimator/geometry/se3.hpp"
#include "mapping/map/stored_blocks.hpp"
#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

/// The blocks that it may reach into: from `low` to `high`, both among them.
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

  /// Into blocks of `within`, for which there is room (VoxelVolume::obtain). A free block ends what stands in
  /// its parts, and no more.
  void add(const StoredBlock& block, const SE3& motion, const BlockRange& within);
  /// After all of these: the free parts of blocks, laid together where no voxel is known. A part is free when
  /// the middles of all its voxels fall into free parts of any of the blocks.
  void beginFree(const BlockRange& within);
  void addFree(const StoredBlock& block, const SE3& motion);
  void endFree();
  /// Into voxels alone of which nothing is known, with kHintWeight; blocks that are farther from `vehicle`
  /// than all others are left out when the volume is full. A free block into blocks that no image has seen.
  void hint(const StoredBlock& block, const SE3& motion, const Eigen::Vector3f& vehicle);

 private:
  /// Of a voxel that a centre of the volume's falls into.
  struct Sample {
    std::size_t at = 0;  ///< in the moved block
    float distance = 0;  ///< at the centre [steps]
  };

  using VoxelSet = std::bitset<kBlockVoxels>;

  void place(const StoredBlock& block, const SE3& motion);
  template <typename Take>
  void forFree(const BlockRange& within, const Take& take) const;
  template <typename Take>
  void fill(const BlockIndex& to, const Take& take) const;
  [[nodiscard]] bool reaches(const BlockIndex& to) const;
  /// False where the centre does not fall in; `at`: where it does.
  [[nodiscard]] bool fallsIn(const VoxelIndex& voxel, std::size_t& at, Eigen::Vector3f& rest) const;
  void addVoxels(const BlockIndex& to);
  void endWhatStands(const BlockIndex& to);
  void fillFree(std::uint32_t slot, std::uint64_t parts);
  void finish(std::uint32_t slot);

  VoxelVolume& volume_;
  const StoredBlock* block_ = nullptr;
  BlockRange box_;            ///< of blocks that the moved one touches
  Eigen::Matrix3d to_block_;  ///< from a voxel's number to the moved block's, in voxels
  Eigen::Vector3d at_block_;
  std::vector<BlockIndex> wanted_;  ///< scratch
  BlockRange free_range_;
  std::vector<VoxelSet> free_;  ///< of each block in it, x fastest
};

}  // namespace swiftlet
