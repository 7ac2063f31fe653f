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
  /// Voxels of less weight count as unobserved.
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
  static constexpr int kCorners = kBlockSide + 1;  ///< along an edge
  static constexpr std::uint16_t kNoVertex = 0xFFFF;

  [[nodiscard]] static std::size_t padded(int x, int y, int z) {
    return static_cast<std::size_t>((x + kBefore) + kPad * ((y + kBefore) + kPad * (z + kBefore)));
  }
  bool gatherNeighbours(const BlockIndex& block);
  void fillPadded();
  void addCube(int x, int y, int z, SurfacePatch& patch);
  std::uint16_t vertexOn(int axis, int x, int y, int z, SurfacePatch& patch);
  [[nodiscard]] Eigen::Vector3f gradient(int x, int y, int z) const;
  void attributes(int x, int y, int z, SurfaceVertex& vertex) const;

  const VoxelVolume& volume_;
  const ConfusionModel& confusion_;
  SurfaceSettings settings_;
  std::uint16_t least_weight_;
  float most_step_;  ///< in steps of a distance; above any difference when there is no limit
  BlockIndex block_;
  std::array<std::uint32_t, 27> neighbour_{};
  std::array<float, static_cast<std::size_t>(kPad) * kPad * kPad> value_{};  ///< [steps]; kUnknown
  std::array<std::array<std::uint16_t, static_cast<std::size_t>(kCorners) * kCorners * kCorners>, 3>
      vertex_{};
};

}  // namespace swiftlet
