#pragma once
// Marching cubes over one block (Lorensen, Cline, SIGGRAPH 1987; cases: cube_cases.hpp).
//
// A block has the cubes whose lowest corner is a voxel of it; their other corners, and the differences that
// normals come from, reach into the 26 neighbours. A cube gives surface when all its corners were observed.
// Vertices lie where the distance, linear along an edge, is zero, computed from the lower corner on in
// numbers of the whole world: neighbours agree to the bit. A vertex takes grey and label from the nearer
// corner. Cost: docs/volume.md. Not thread safe: scratch memory of its own.

#include <array>
#include <cstdint>
#include <vector>

#include "mapping/surface/surface_patch.hpp"
#include "mapping/volume/confusion_model.hpp"
#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

struct SurfaceSettings {
  /// Of a depth sensor, whose errors are those that it says: one measurement is a surface.
  static constexpr double kLeastSensorWeight = 1.0 / kWeightSteps;

  /// Voxels of less weight count as unobserved. Stereo repeats its mismatches from image to image: it takes
  /// more than one.
  double least_weight = 0.02;
  /// No surface passes through a cube in which distances along an edge differ by more voxels than this: such
  /// a step is the edge of what was seen, between a thing and the free space beside it. 0: no limit.
  double most_step = 0;
};

class BlockSurface {
 public:
  BlockSurface(const VoxelVolume& volume, const ConfusionModel& confusion, const SurfaceSettings& settings);

  /// The surface of a block with voxels; empty for others.
  void extract(std::uint32_t slot, SurfacePatch& patch);

 private:
  static constexpr int kBefore = 1;                ///< voxels below the block
  static constexpr int kPad = kBlockSide + 3;      ///< one below, two above
  static constexpr int kRow = 3 * kBlockSide;      ///< of them in memory, so that the block's own are aligned
  static constexpr int kCorners = kBlockSide + 1;  ///< along an edge
  static constexpr std::uint16_t kNoVertex = 0xFFFF;
  /// Of a voxel that was not observed; no distance is as low.
  static constexpr std::int16_t kUnknown = -32768;

  /// Of each row of corners along x, bit by bit.
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
  int most_step_;  ///< in steps of a distance; above any difference when there is no limit
  BlockIndex block_;
  std::array<std::uint32_t, 27> neighbour_{};
  Bits behind_{};
  Bits known_{};
  alignas(16) std::array<std::int16_t, static_cast<std::size_t>(kRow) * kPad * kPad> value_{};  ///< [steps]
  std::array<std::uint16_t, std::size_t{3} * kCorners * kCorners * kCorners> vertex_{};  ///< of each edge
};

}  // namespace swiftlet
