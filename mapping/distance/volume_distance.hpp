#pragma once
// Updates a distance field from a volume: surfaces, free space and unknown space of changed blocks.
//
// A step moves the window with the vehicle, reads changed blocks and their neighbours, and updates the field.
// It reads at most `effort.blocks` blocks, in the order of the volume's slots, and continues where the last
// step ended. A voxel holds surface if the signed distance changes sign towards a neighbour that is not
// nearer to the surface; one Newton step along the slope of the distance gives the surface point. Dropped
// blocks become unknown. Cells are the volume's voxels. Map axes, metres. Memory: 17 bytes for each slot of
// the volume, besides the field. Not thread safe, except for the field's readers.

#include <array>
#include <vector>

#include "mapping/distance/distance_field.hpp"
#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

struct DistanceEffort {
  std::size_t blocks = 1000;  ///< read per step; 3 us each
};

struct DistanceStep {
  std::size_t blocks = 0;  ///< read
  bool caught_up = false;  ///< no block waits to be read
};

class VolumeDistance {
 public:
  /// The field's cell size must be the volume's voxel size. Both must outlive this object.
  VolumeDistance(const VoxelVolume& volume, DistanceField& field);

  /// `newest`: stamp of the newest image in the volume.
  void step(Stamp newest, const Eigen::Vector3d& p_map_vehicle, const DistanceEffort& effort,
            DistanceStep& out);

 private:
  struct Seen {
    std::uint64_t key = 0;  ///< of the block; 0: none
    std::uint32_t revision = 0;
  };

  [[nodiscard]] bool inWindow(const BlockIndex& block, const Eigen::Vector3i& origin) const;
  void findChanges();
  void ask(std::uint32_t slot);
  void askAround(const BlockIndex& block);
  void read(std::uint32_t slot);
  void fill(const BlockIndex& block, std::uint64_t free_parts);
  void gather(std::uint32_t slot);
  void readRow(const Eigen::Vector3i& first, int y, int z);
  [[nodiscard]] static CellSurface surfaceAt(const float* own);

  static constexpr std::uint32_t kWholeRow = (1U << kBlockSide) - 1;
  // Size of the present block with one voxel beyond each face.
  static constexpr int kSide = kBlockSide + 2;
  static constexpr std::array<int, 3> kSteps{1, kSide, kSide* kSide};  ///< to the next along each axis
  [[nodiscard]] static std::size_t placeOf(int x, int y, int z) {
    return static_cast<std::size_t>((x + 1) + kSide * ((y + 1) + kSide * (z + 1)));
  }

  const VoxelVolume& volume_;
  DistanceField& field_;
  std::vector<Seen> seen_;           ///< by slot
  std::vector<std::uint8_t> waits_;  ///< by slot: 1 if the block must be read
  std::size_t waiting_ = 0;
  std::uint32_t cursor_ = 0;
  Stamp up_to_;   ///< images up to here are in the field
  Stamp newest_;  ///< of the last step
  std::array<float, static_cast<std::size_t>(kSide) * kSide * kSide> value_{};  ///< m; NaN: unobserved
};

}  // namespace swiftlet
