#pragma once
// Indices of voxels and of cubes of voxels ("blocks"), the units of the volume.
//
// World axes. Voxel (i, j, k) has its centre at (i + 1/2, j + 1/2, k + 1/2) voxel sizes; block (x, y, z)
// holds the 8 x 8 x 8 voxels from voxel 8 (x, y, z). Within a block x runs fastest.

#include <Eigen/Core>
#include <compare>
#include <cstddef>
#include <cstdint>

namespace swiftlet {

inline constexpr int kBlockBits = 3;
/// Voxels along an edge of a block. Eight, so that a row fills one vector.
inline constexpr int kBlockSide = 1 << kBlockBits;
inline constexpr int kBlockMask = kBlockSide - 1;
inline constexpr std::size_t kBlockVoxels = std::size_t{1} << (3 * kBlockBits);

/// Largest block coordinate along each axis, so that 21 bits hold it.
inline constexpr std::int32_t kBlockLimit = (1 << 20) - 2;

struct BlockIndex {
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::int32_t z = 0;

  auto operator<=>(const BlockIndex&) const = default;
  BlockIndex operator+(const BlockIndex& o) const { return {x + o.x, y + o.y, z + o.z}; }
  [[nodiscard]] bool inRange() const {
    const auto within = [](std::int32_t i) { return i >= -kBlockLimit && i <= kBlockLimit; };
    return within(x) && within(y) && within(z);
  }
};

using VoxelIndex = BlockIndex;

/// Unique key of a block in range; never zero.
inline std::uint64_t keyOf(const BlockIndex& block) {
  const auto part = [](std::int32_t i) {
    return static_cast<std::uint64_t>(static_cast<std::uint32_t>(i + (1 << 20)));
  };
  return part(block.x) | (part(block.y) << 21U) | (part(block.z) << 42U) | (std::uint64_t{1} << 63U);
}

/// Inverse of keyOf().
inline BlockIndex indexFrom(std::uint64_t key) {
  const auto part = [key](unsigned shift) {
    return static_cast<std::int32_t>(key >> shift & 0x1FFFFFU) - (1 << 20);
  };
  return {part(0), part(21), part(42)};
}

inline BlockIndex blockOf(const VoxelIndex& voxel) {
  return {voxel.x >> kBlockBits, voxel.y >> kBlockBits, voxel.z >> kBlockBits};
}

/// Index of a voxel within its block.
inline std::size_t offsetOf(const VoxelIndex& voxel) {
  const auto part = [](std::int32_t along, unsigned axis) {
    return static_cast<std::size_t>(along & kBlockMask) << (kBlockBits * axis);
  };
  return part(voxel.x, 0) + part(voxel.y, 1) + part(voxel.z, 2);
}

/// The voxel at this index of a block.
inline VoxelIndex voxelOf(const BlockIndex& block, std::size_t offset) {
  const auto along = [offset](unsigned axis) {
    return static_cast<std::int32_t>(offset >> (kBlockBits * axis)) & kBlockMask;
  };
  return {kBlockSide * block.x + along(0), kBlockSide * block.y + along(1), kBlockSide * block.z + along(2)};
}

/// Identifies a submap, whose images move rigidly (mapping/map/submaps.hpp).
using SubmapId = std::uint16_t;

/// Free space of a block without voxels is known by parts: 64 cubes of 2 x 2 x 2 voxels, a bit each, x
/// fastest.
inline constexpr int kPartVoxels = 2;
inline constexpr int kPartsAlong = kBlockSide / kPartVoxels;
inline constexpr std::uint64_t kAllParts = ~std::uint64_t{0};
static_assert(kPartsAlong * kPartsAlong * kPartsAlong == 64);

/// Bit of part (x, y, z) of a block; each coordinate is 0 to kPartsAlong - 1.
constexpr std::uint64_t partBit(int x, int y, int z) {
  return std::uint64_t{1} << static_cast<unsigned>(x + kPartsAlong * (y + kPartsAlong * z));
}
/// Bit of the part that holds the voxel at this index of a block.
constexpr std::uint64_t partBitAt(std::size_t offset) {
  const auto along = [offset](int axis) {
    return static_cast<int>(offset >> static_cast<unsigned>(axis * kBlockBits)) % kBlockSide / kPartVoxels;
  };
  return partBit(along(0), along(1), along(2));
}

}  // namespace swiftlet
