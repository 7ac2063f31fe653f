#include "firmware_host/lab/modules/map_slice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "drivers/input/input_error.hpp"
#include "mapping/distance/volume_distance.hpp"

namespace swiftlet {
namespace {

constexpr int kTile = 128;  // side length in voxels of the part used from one window
static_assert(kTile % kDistanceStep == 0);

/// Voxels from `least` (included) to `most` (excluded).
struct VoxelBox {
  Eigen::Vector3i least = Eigen::Vector3i::Constant(std::numeric_limits<int>::max());
  Eigen::Vector3i most = Eigen::Vector3i::Constant(std::numeric_limits<int>::min());

  void add(const Eigen::Vector3i& first) {
    least = least.cwiseMin(first);
    most = most.cwiseMax((first.array() + kBlockSide).matrix());
  }
  [[nodiscard]] bool empty() const { return most.x() < least.x(); }
};

/// First voxels of the known blocks.
std::vector<Eigen::Vector3i> knownBlocks(const VoxelVolume& volume) {
  std::vector<Eigen::Vector3i> blocks;
  for (std::uint32_t slot = 0; slot < volume.slots(); ++slot) {
    const BlockHeader& header = volume.header(slot);
    if (header.state == BlockState::kUnused) continue;
    blocks.push_back(Eigen::Vector3i(header.index.x, header.index.y, header.index.z) * kBlockSide);
  }
  return blocks;
}

/// Whether the volume has a surface: voxels with negative distance.
bool hasSurface(const VoxelVolume& volume) {
  for (std::uint32_t slot = 0; slot < volume.slots(); ++slot) {
    const BlockHeader& header = volume.header(slot);
    if (header.state == BlockState::kVoxels && (header.sides & BlockHeader::kBehind) != 0) return true;
  }
  return false;
}

VoxelBox boxOf(const std::vector<Eigen::Vector3i>& blocks) {
  VoxelBox box;
  for (const Eigen::Vector3i& block : blocks) box.add(block);
  return box;
}

int layerOf(const std::string& name, const VoxelBox& box, double voxel_size, std::optional<double> z) {
  if (!z) return box.least.z() + (box.most.z() - box.least.z()) / 2;
  const double layer = std::floor(*z / voxel_size);
  if (!(layer >= box.least.z() && layer < box.most.z())) {
    throw InputError(name, 0, "--z", fmt::format("{:g} m is outside the map", *z),
                     fmt::format("Give a height from {:g} m to below {:g} m", box.least.z() * voxel_size,
                                 box.most.z() * voxel_size));
  }
  return static_cast<int>(layer);
}

DistanceLimits windowLimits(double voxel_size) {
  DistanceLimits limits;
  // Margin between the used part and the window's edge: the reach, and a block for the cells around a point
  // and the steps of a query along the surface.
  const int margin = (limits.reach + 2 * kDistanceStep - 1) / kDistanceStep * kDistanceStep;
  // The layer may be anywhere within a step of the window.
  limits.cells = {kTile + 2 * margin, kTile + 2 * margin, 2 * (margin + kDistanceStep)};
  limits.cell_size = voxel_size;
  return limits;
}

SliceKind kindOf(const DistanceSample& sample, bool surface) {
  if (sample.kind == DistanceKind::kUnknown) return SliceKind::kUnknown;
  if (surface) return SliceKind::kSurface;
  if (sample.space == Space::kBehindSurface) return SliceKind::kBehindSurface;
  return sample.kind == DistanceKind::kAtLeast ? SliceKind::kAtLeast : SliceKind::kDistance;
}

/// Draws the voxels from `first` on, kTile along x and y, into the slice whose box begins at `corner`.
void drawTile(const VoxelVolume& volume, const Eigen::Vector3i& first, const Eigen::Vector3i& corner,
              MapSlice& slice) {
  DistanceField field(windowLimits(slice.voxel_size));
  const Eigen::Vector3i middle = first + Eigen::Vector3i(kTile / 2, kTile / 2, 0);
  const Eigen::Vector3d p = field.centreOf(middle);
  // The window does not follow short moves: it is exactly around `p` only if it comes from far away.
  field.follow(field.centreOf(middle - field.limits().cells));
  field.follow(p);
  VolumeDistance distance(volume, field);
  DistanceStep step;
  distance.step({}, p, {std::numeric_limits<std::size_t>::max()}, step);
  const int right = std::min(first.x() + kTile, corner.x() + slice.width);
  const int above = std::min(first.y() + kTile, corner.y() + slice.height);
  for (int y = first.y(); y < above; ++y) {
    for (int x = first.x(); x < right; ++x) {
      const Eigen::Vector3i voxel(x, y, first.z());
      const DistanceSample sample = field.query(field.centreOf(voxel));
      const auto at =
          static_cast<std::size_t>((slice.height - 1 - (y - corner.y())) * slice.width + (x - corner.x()));
      slice.kind[at] = kindOf(sample, field.holdsSurface(voxel));
      if (sample.kind == DistanceKind::kDistance) slice.distance[at] = static_cast<float>(sample.distance);
    }
  }
}

}  // namespace

std::array<std::size_t, kSliceKinds> MapSlice::counts() const {
  std::array<std::size_t, kSliceKinds> counts{};
  for (const SliceKind one : kind) ++counts[static_cast<std::size_t>(one)];
  return counts;
}

double MapSlice::largestDistance() const {
  float largest = 0;
  for (std::size_t i = 0; i < kind.size(); ++i) {
    if (kind[i] == SliceKind::kDistance) largest = std::max(largest, distance[i]);
  }
  return static_cast<double>(largest);
}

MapSlice sliceOf(const std::string& name, const VoxelVolume& volume, std::optional<double> z) {
  if (!hasSurface(volume)) {
    throw InputError(name, 0, "", "the map has no surface", "Keep a map from a log with fused depth");
  }
  const double voxel_size = volume.settings().voxel_size;
  std::vector<Eigen::Vector3i> blocks = knownBlocks(volume);
  const int layer = layerOf(name, boxOf(blocks), voxel_size, z);
  std::erase_if(blocks, [&](const Eigen::Vector3i& first) {
    return layer < first.z() || layer >= first.z() + kBlockSide;
  });
  MapSlice slice;
  slice.voxel_size = voxel_size;
  slice.z = (layer + 0.5) * voxel_size;
  const VoxelBox box = boxOf(blocks);
  if (box.empty()) {
    throw InputError(name, 0, "--z", fmt::format("nothing is known at {:g} m", slice.z),
                     "Give another height");
  }
  const Eigen::Vector2i size = (box.most - box.least).head<2>();
  if (size.maxCoeff() > kMostSliceSide) {
    throw InputError(name, 0, "--z",
                     fmt::format("the map is {} x {} voxels wide at {:g} m, above {} a side", size.x(),
                                 size.y(), slice.z, kMostSliceSide),
                     "Give another height, or keep a map with larger voxels (map.voxel_size)");
  }
  slice.reach = DistanceLimits{}.reach * voxel_size;
  slice.least = box.least.head<2>().cast<double>() * voxel_size;
  slice.most = box.most.head<2>().cast<double>() * voxel_size;
  slice.width = size.x();
  slice.height = size.y();
  const auto pixels = static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y());
  slice.kind.assign(pixels, SliceKind::kUnknown);
  slice.distance.assign(pixels, std::numeric_limits<float>::quiet_NaN());
  const Eigen::Vector2i tiles = (size.array() + kTile - 1) / kTile;
  // Tiles without blocks stay unknown.
  std::vector<bool> holds(static_cast<std::size_t>(tiles.prod()));
  for (const Eigen::Vector3i& block : blocks) {
    const Eigen::Vector3i tile = (block - box.least) / kTile;
    holds[static_cast<std::size_t>(tile.y() * tiles.x() + tile.x())] = true;
  }
  for (int i = 0; i < tiles.prod(); ++i) {
    if (!holds[static_cast<std::size_t>(i)]) continue;
    drawTile(volume, {box.least.x() + i % tiles.x() * kTile, box.least.y() + i / tiles.x() * kTile, layer},
             box.least, slice);
  }
  return slice;
}

}  // namespace swiftlet
