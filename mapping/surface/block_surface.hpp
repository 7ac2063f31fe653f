#pragma once
// Marching cubes over one block (Lorensen, Cline, SIGGRAPH 1987; cases: cube_cases.hpp).
//
// A block has the cubes whose lowest corner is one of its voxels; their other corners, and the differences
// for normals, reach into the 26 neighbours. A cube gives surface if all its corners were observed. Vertices
// lie where the distance, linear along an edge, is zero. They are computed from the lower corner in world
// coordinates, so that neighbouring blocks agree to the bit. A vertex takes grey and label from the nearer
// corner. Cost: docs/experiments/map.md. Not thread safe: has scratch memory.

#include <array>
#include <cstdint>
#include <vector>

#include "mapping/surface/surface_patch.hpp"
#include "mapping/volume/confusion_model.hpp"
#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

struct SurfaceSettings {
  /// `least_weight` for a depth sensor, whose sigma describes its errors: one measurement gives a surface.
  static constexpr double kLeastSensorWeight = 1.0 / kWeightSteps;

  /// Voxels of less weight count as unobserved. Larger values need more measurements for a surface; stereo
  /// needs more than one, because a mismatch may repeat from image to image.
  double least_weight = 0.02;
  /// A cube has no surface if distances along one of its edges differ by more than this [voxels]. Such a step
  /// is the border of the observed surface, beside free space. 0: no limit.
  double most_step = 0;
};

class BlockSurface {
 public:
  BlockSurface(const VoxelVolume& volume, const ConfusionModel& confusion, const SurfaceSettings& settings);

  /// The surface of a block with voxels; empty for others.
  void extract(std::uint32_t slot, SurfacePatch& patch);

 private:
  static constexpr int kBefore = 1;                ///< voxels below the block
  static constexpr int kPad = kBlockSide + 3;      ///< one voxel below, two above
  static constexpr int kRow = 3 * kBlockSide;      ///< row length in memory; aligns the block's own voxels
  static constexpr int kCorners = kBlockSide + 1;  ///< along an edge
  static constexpr std::uint16_t kNoVertex = 0xFFFF;
  /// Value of an unobserved voxel, below any distance.
  static constexpr std::int16_t kUnknown = -32768;

  /// A bit for each corner of each row along x.
  using Bits = std::array<std::array<std::uint32_t, kCorners>, kCorners>;

  [[nodiscard]] static std::size_t padded(int x, int y, int z) {
    return static_cast<std::size_t>((x + kBlockSide) + kRow * ((y + kBefore) + kPad * (z + kBefore)));
  }
  [[nodiscard]] static std::size_t edgeAt(int axis, int x, int y, int z) {
    return static_cast<std::size_t>(x + kCorners * (y + kCorners * (z + kCorners * axis)));
  }
  bool gatherNeighbours(const BlockIndex& block);
  void fillPadded();
  [[nodiscard]] std::uint32_t cubesIn(std::size_t y, std::size_t z) const;
  void fillRow(int y, int z, const std::array<const VoxelBlock*, 3>& along);
  void addCube(int x, int y, int z, SurfacePatch& patch);
  [[nodiscard]] int steps(int x, int y, int z) const;
  std::uint16_t newVertex(int axis, int x, int y, int z, SurfacePatch& patch) const;
  [[nodiscard]] Eigen::Vector3f gradient(int x, int y, int z) const;
  void attributes(int x, int y, int z, SurfaceVertex& vertex) const;

  const VoxelVolume& volume_;
  const ConfusionModel& confusion_;
  SurfaceSettings settings_;
  std::uint16_t least_weight_;
  int most_step_;  ///< in steps of a distance; above any difference if there is no limit
  BlockIndex block_;
  std::array<std::uint32_t, 27> neighbour_{};
  Bits behind_{};
  Bits known_{};
  alignas(16) std::array<std::int16_t, static_cast<std::size_t>(kRow) * kPad * kPad> value_{};  ///< [steps]
  std::array<std::uint16_t, std::size_t{3} * kCorners * kCorners * kCorners> vertex_{};  ///< of each edge
};

}  // namespace swiftlet
