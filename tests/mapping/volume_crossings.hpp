#pragma once
// Where a volume's surface passes between voxels, for brute force beside the distance field.

#include <Eigen/Core>
#include <vector>

#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet::testing {

/// Towards the neighbours of a voxel between which and it the distance changes sign [voxels]. Only voxels
/// that were seen.
template <typename Found>
void forCrossings(const VoxelVolume& volume, const VoxelIndex& voxel, const Found& found) {
  float own = 0, other = 0;
  if (!volume.distanceAt(voxel, own)) return;
  for (int axis = 0; axis < 3; ++axis) {
    for (const int sign : {-1, 1}) {
      const Eigen::Vector3i step = sign * Eigen::Vector3i::Unit(axis);
      if (!volume.distanceAt(voxel + VoxelIndex{step.x(), step.y(), step.z()}, other)) continue;
      if ((own < 0) != (other < 0)) found(static_cast<double>(own / (own - other)) * step.cast<double>());
    }
  }
}

/// All of them [m]. The surface's mesh goes through the same points, but for cells of which not all corners
/// were seen: there it has none.
inline std::vector<Eigen::Vector3d> surfaceCrossings(const VoxelVolume& volume) {
  std::vector<Eigen::Vector3d> points;
  for (std::uint32_t slot = 0; slot < volume.slots(); ++slot) {
    if (volume.voxels(slot) == nullptr) continue;
    const BlockIndex& block = volume.header(slot).index;
    for (int i = 0; i < static_cast<int>(kBlockVoxels); ++i) {
      const Eigen::Vector3i within(i % kBlockSide, i / kBlockSide % kBlockSide, i / kBlockSide / kBlockSide);
      const Eigen::Vector3i voxel = Eigen::Vector3i(block.x, block.y, block.z) * kBlockSide + within;
      forCrossings(volume, {voxel.x(), voxel.y(), voxel.z()}, [&](const Eigen::Vector3d& to) {
        points.emplace_back((voxel.cast<double>() + Eigen::Vector3d::Constant(0.5) + to) *
                            static_cast<double>(volume.voxelSize()));
      });
    }
  }
  return points;
}

}  // namespace swiftlet::testing
