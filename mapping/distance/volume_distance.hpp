#pragma once
// Keeps a distance field true to a volume: surfaces, free space and the unknown, as blocks change.
//
// Per step: the window follows the vehicle; at most `effort.blocks` blocks that changed since they were last
// read are read, in the order of the volume's slots from where the last step ended; then the field is
// updated. A voxel holds surface where the signed distance changes sign to
// a neighbour that lies no nearer; the surface point is where the distance's slope leads to zero (one Newton
// step), so it is found to a part of a voxel. What the volume dropped becomes unknown. Cells are the volume's
// voxels. Map axes, metres. Memory: 16 bytes for each of the volume's slots, beside the field's. Not thread
// safe; the field's readers are free.

#include <array>
#include <vector>

#include "mapping/distance/distance_field.hpp"
#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

struct DistanceEffort {
  std::size_t blocks = 500;
};

struct DistanceStep {
  std::size_t blocks = 0;  ///< read
  bool caught_up = false;  ///< no block waits
};

class VolumeDistance {
 public:
  /// `limits.cell_size` is the volume's. Both outlive this.
  VolumeDistance(const VoxelVolume& volume, DistanceField& field);

  /// `newest`: stamp of the newest image in the volume.
  void step(Stamp newest, const Eigen::Vector3d& p_map_vehicle, const DistanceEffort& effort,
            DistanceStep& out);

 private:
  struct Seen {
    std::uint64_t key = 0;  ///< of the block; 0: none
    std::uint32_t revision = 0;
  };

  void forgetEntered(const Eigen::Vector3i& origin_before);
  [[nodiscard]] bool inWindow(const BlockIndex& block) const;
  static constexpr int kSignRow = kBlockSide + 2, kSignSide = kBlockSide + 2;
  [[nodiscard]] static std::size_t signAt(int x, int y, int z) {
    return static_cast<std::size_t>((x + 1) + kSignRow * ((y + 1) + kSignSide * (z + 1)));
  }

  void read(std::uint32_t slot);
  void fill(const BlockIndex& block, Space space);
  void gatherValues();
  void readRow(const VoxelIndex& first, int y, int z);
  void readBorder(const VoxelIndex& first);
  void readVoxel(const VoxelIndex& voxel);
  void gatherAround(const BlockIndex& block);
  bool valueAt(const VoxelIndex& voxel, float& distance) const;
  void erase(std::uint64_t key);

  const VoxelVolume& volume_;
  DistanceField& field_;
  std::vector<Seen> seen_;  ///< by slot
  std::uint32_t cursor_ = 0;
  Stamp up_to_;  ///< images up to here are in the field
  // Of the block in hand: its slot and those around it, x fastest.
  BlockIndex block_;
  std::array<std::uint32_t, 27> around_{};
  std::array<std::int8_t, static_cast<std::size_t>(kSignRow) * kSignSide * kSignSide> sign_{};
};

}  // namespace swiftlet
