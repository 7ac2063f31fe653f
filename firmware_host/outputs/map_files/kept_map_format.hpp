#pragma once
// The layout of a kept map, shared by writer and reader; docs/formats.md has the tables.
//
// A head of kHeadBytes, then records back to back: kRecordBytes and a payload. Numbers are little-endian;
// doubles and floats are IEEE 754. The CRC of each record continues from the head's, so that a record of
// another map is never accepted.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "firmware_host/outputs/map_files/kept_map.hpp"
#include "mapping/surface/surface_patch.hpp"

namespace swiftlet::kept {

/// Same scheme as a recording's magic (recording_format.hpp).
inline constexpr std::array<std::uint8_t, 8> kMagic{0x89, 'S', 'W', 'M', '\r', '\n', 0x1A, '\n'};
inline constexpr std::uint32_t kVersion = 3;
/// Had surface patches after the blocks; their number stood in place of the surface's least weight.
inline constexpr std::uint32_t kVersionWithPatches = 2;
/// Blocks were free as a whole or not at all: the number of images that saw them free stood in place of their
/// free parts.
inline constexpr std::uint32_t kVersionOfWholeBlocks = 1;
inline constexpr std::size_t kHeadBytes = 96;
inline constexpr std::size_t kHeadCrcAt = kHeadBytes - sizeof(std::uint32_t);
inline constexpr std::uint32_t kHasLabels = 1;

enum class Kind : std::uint16_t { kEnd = 0, kBlock = 1, kFree = 2, kPatch = 3 };

/// u32 CRC of all that follows in the record, u16 kind, u16 zero, u32 payload bytes.
inline constexpr std::size_t kRecordBytes = 12;
inline constexpr std::size_t kIndexBytes = 12;
/// Index, sides, three zeros, drift, then distances, weights, grey values.
inline constexpr std::size_t kBlockBytes = kIndexBytes + 8 + kBlockVoxels * 5;
inline constexpr std::size_t kLabelBytes = kBlockVoxels * 8;
/// Index, parts seen as free.
inline constexpr std::size_t kFreeBytes = kIndexBytes + 8;
inline constexpr std::size_t kFreeBytesOfWholeBlocks = kIndexBytes + 4;
inline constexpr std::size_t kMostFree = 256;  ///< per record
/// Size of a patch: index, counts, vertices, triangles.
inline constexpr std::size_t kMostPayload =
    kIndexBytes + 4 + kMostPatchVertices * 18 + kMostPatchTriangles * 6;
static_assert(kMostPayload >= kBlockBytes + kLabelBytes && kMostPayload >= kMostFree * kFreeBytes);

struct Head {
  double voxel_size = 0;
  double truncation = 0;
  double reference_sigma = 0;
  bool labels = false;
  std::uint32_t epoch = 0;
  KeptMapCounts counts;
  Eigen::Vector3d p_map_vehicle = Eigen::Vector3d::Zero();
  double least_weight = SurfaceSettings{}.least_weight;
};

/// Order of blocks in a file: by distance from the vehicle's block, ties by key.
struct Nearness {
  std::uint64_t squared = 0;  ///< blocks^2
  std::uint64_t key = 0;
  auto operator<=>(const Nearness&) const = default;
};

inline BlockIndex vehicleBlock(const Head& head) {
  const double block = head.voxel_size * kBlockSide;
  const auto along = [&](double at) {
    const double limited = std::clamp(std::floor(at / block), -1.0 * kBlockLimit, 1.0 * kBlockLimit);
    return static_cast<std::int32_t>(limited);
  };
  return {along(head.p_map_vehicle.x()), along(head.p_map_vehicle.y()), along(head.p_map_vehicle.z())};
}

inline Nearness nearness(const BlockIndex& block, const BlockIndex& vehicle) {
  const auto square = [](std::int32_t a, std::int32_t b) {
    const std::int64_t d = std::int64_t{a} - b;
    return static_cast<std::uint64_t>(d * d);
  };
  return {square(block.x, vehicle.x) + square(block.y, vehicle.y) + square(block.z, vehicle.z), keyOf(block)};
}

}  // namespace swiftlet::kept
