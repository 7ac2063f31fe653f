#include "mapping/surface/block_surface.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "mapping/surface/cube_cases.hpp"
#include "mapping/volume/lanes.hpp"

namespace swiftlet {
namespace {

/// Stands for a block without voxels: wholly free or never observed.
constexpr VoxelBlock evenBlock(std::uint16_t weight) {
  VoxelBlock block{};
  block.distance.fill(static_cast<std::int16_t>(kDistanceSteps));
  block.weight.fill(weight);
  return block;
}
constexpr VoxelBlock kFreeBlock = evenBlock(std::numeric_limits<std::uint16_t>::max());
constexpr VoxelBlock kNowhereSeen = evenBlock(0);
/// Larger than any difference of distances [steps].
constexpr int kNoLimit = 1 << 17;
/// Least distance of a vertex from the ends of its edge, as a share of the edge, so that no two corners of a
/// triangle coincide.
constexpr float kEdgeMargin = 1e-3F;

constexpr std::size_t neighbourAt(int x, int y, int z) {
  return static_cast<std::size_t>((x + 1) + 3 * ((y + 1) + 3 * (z + 1)));
}

/// Corners along a side of the block, and edges along one axis.
constexpr std::size_t kSide = kBlockSide + 1, kEdges = kSide * kSide * kSide;
/// Offset from the index of a cube's lowest corner to that of each of its edges.
constexpr std::array<std::uint16_t, 12> kEdgePlace = [] {
  std::array<std::uint16_t, 12> place{};
  for (std::size_t e = 0; e < place.size(); ++e) {
    const std::size_t from = kCubeEdges[e].from;
    place[e] = static_cast<std::uint16_t>(kCubeEdges[e].axis * kEdges + (from & 1U) +
                                          kSide * ((from >> 1U & 1U) + kSide * (from >> 2U)));
  }
  return place;
}();

std::uint16_t weightSteps(double weight) {
  return static_cast<std::uint16_t>(std::clamp(weight * kWeightSteps, 1.0, 65535.0));
}

std::int8_t quantised(float x) {
  return static_cast<std::int8_t>(static_cast<int>(127 * x + (x < 0 ? -0.5F : 0.5F)));
}

}  // namespace

BlockSurface::BlockSurface(const VoxelVolume& volume, const ConfusionModel& confusion,
                           const SurfaceSettings& settings)
    : volume_(volume),
      confusion_(confusion),
      settings_(settings),
      least_weight_(weightSteps(settings.least_weight)),
      most_step_(settings.most_step > 0
                     ? static_cast<int>(std::min(static_cast<float>(settings.most_step) * volume.voxelSize() /
                                                     volume.distanceStep(),
                                                 static_cast<float>(kNoLimit)))
                     : kNoLimit) {}

/// Finds the neighbours. False if all voxels that the block's cubes touch are on one side of the surface.
bool BlockSurface::gatherNeighbours(const BlockIndex& block) {
  block_ = block;
  std::uint8_t sides = 0;
  for (int z = 0; z <= 1; ++z) {
    for (int y = 0; y <= 1; ++y) {
      for (int x = 0; x <= 1; ++x) {
        const std::uint32_t slot = volume_.find(block + BlockIndex{x, y, z});
        neighbour_[neighbourAt(x, y, z)] = slot;
        if (slot == VoxelVolume::kNone) continue;
        const BlockHeader& header = volume_.header(slot);
        sides =
            static_cast<std::uint8_t>(sides | (header.isWhollyFree() ? BlockHeader::kInFront : header.sides));
      }
    }
  }
  if (sides != (BlockHeader::kInFront | BlockHeader::kBehind)) return false;
  for (int z = -1; z <= 1; ++z) {
    for (int y = -1; y <= 1; ++y) {
      for (int x = -1; x <= 1; ++x) {
        if (std::min({x, y, z}) < 0) {
          neighbour_[neighbourAt(x, y, z)] = volume_.find(block + BlockIndex{x, y, z});
        }
      }
    }
  }
  return true;
}

/// Fills the row of voxels at (y, z), from x = -1 to kBlockSide + 1, from the three blocks along it.
void BlockSurface::fillRow(int y, int z, const std::array<const VoxelBlock*, 3>& along) {
  const std::size_t from = offsetOf({0, y, z});
  const auto one = [&](const VoxelBlock* block, std::size_t at) {
    return block->weight[at] >= least_weight_ ? block->distance[at] : kUnknown;
  };
  std::int16_t* const row = &value_[padded(0, y, z)];
  row[-1] = one(along[0], from + kBlockMask);
  lanes::Shorts distance;
  lanes::UnsignedShorts weight;
  lanes::load(distance, &along[1]->distance[from]);
  lanes::load(weight, &along[1]->weight[from]);
  const lanes::Shorts known = weight >= least_weight_;
  const lanes::Shorts value = known ? distance : lanes::Shorts{} + kUnknown;
  lanes::store(row, value);
  row[kBlockSide] = one(along[2], from);
  row[kBlockSide + 1] = one(along[2], from + 1);
  if (y < 0 || z < 0 || y >= kCorners || z >= kCorners) return;
  const std::int16_t last = row[kBlockSide];
  behind_[static_cast<std::size_t>(z)][static_cast<std::size_t>(y)] =
      lanes::bits(value < 0) | (last < 0 ? 1U << kBlockSide : 0U);
  known_[static_cast<std::size_t>(z)][static_cast<std::size_t>(y)] =
      lanes::bits(known) | (last != kUnknown ? 1U << kBlockSide : 0U);
}

void BlockSurface::fillPadded() {
  std::array<const VoxelBlock*, 27> block;
  for (std::size_t i = 0; i < block.size(); ++i) {
    const std::uint32_t slot = neighbour_[i];
    const VoxelBlock* const voxels = slot == VoxelVolume::kNone ? nullptr : volume_.voxels(slot);
    const bool free = slot != VoxelVolume::kNone && volume_.header(slot).isWhollyFree();
    block[i] = voxels != nullptr ? voxels : free ? &kFreeBlock : &kNowhereSeen;
  }
  for (int z = -1; z <= kBlockSide + 1; ++z) {
    for (int y = -1; y <= kBlockSide + 1; ++y) {
      const std::size_t first = neighbourAt(-1, y >> kBlockBits, z >> kBlockBits);
      fillRow(y, z, {block[first], block[first + 1], block[first + 2]});
    }
  }
}

/// One bit per cube of a row: whether the surface passes through it.
inline std::uint32_t BlockSurface::cubesIn(std::size_t y, std::size_t z) const {
  const std::uint32_t any = behind_[z][y] | behind_[z][y + 1] | behind_[z + 1][y] | behind_[z + 1][y + 1];
  const std::uint32_t all = behind_[z][y] & behind_[z][y + 1] & behind_[z + 1][y] & behind_[z + 1][y + 1];
  const std::uint32_t seen = known_[z][y] & known_[z][y + 1] & known_[z + 1][y] & known_[z + 1][y + 1];
  return (any | (any >> 1U)) & ~(all & (all >> 1U)) & seen & (seen >> 1U) & ((1U << kBlockSide) - 1U);
}

void BlockSurface::extract(std::uint32_t slot, SurfacePatch& patch) {
  patch.block = volume_.header(slot).index;
  patch.submap = volume_.header(slot).submap;
  patch.vertices.clear();
  patch.triangles.clear();
  if (volume_.header(slot).state != BlockState::kVoxels || !gatherNeighbours(patch.block)) return;
  fillPadded();
  vertex_.fill(kNoVertex);
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    for (std::size_t y = 0; y < kBlockSide; ++y) {
      for (std::uint32_t left = cubesIn(y, z); left != 0; left &= left - 1)
        addCube(std::countr_zero(left), static_cast<int>(y), static_cast<int>(z), patch);
    }
  }
}

void BlockSurface::addCube(int x, int y, int z, SurfacePatch& patch) {
  const auto row = static_cast<std::size_t>(y), layer = static_cast<std::size_t>(z);
  const auto two = [&](std::size_t dz, std::size_t dy) { return behind_[layer + dz][row + dy] >> x & 3U; };
  const unsigned which = two(0, 0) | two(0, 1) << 2U | two(1, 0) << 4U | two(1, 1) << 6U;
  if (most_step_ < kNoLimit && steps(x, y, z) > most_step_) return;
  const CubeCase& cube = kCubeCases[which];
  const std::size_t first = edgeAt(0, x, y, z);
  for (std::size_t i = 0; i < cube.triangles; ++i) {
    SurfaceTriangle corners;
    for (std::size_t k = 0; k < corners.size(); ++k) {
      const std::uint8_t e = cube.edge[3 * i + k];
      std::uint16_t& vertex = vertex_[first + kEdgePlace[e]];
      if (vertex == kNoVertex) {
        const unsigned from = kCubeEdges[e].from;
        vertex = newVertex(kCubeEdges[e].axis, x + static_cast<int>(from & 1U),
                           y + static_cast<int>(from >> 1U & 1U), z + static_cast<int>(from >> 2U), patch);
      }
      corners[k] = vertex;
    }
    if (!patch.triangles.tryPushBack(corners)) return;
  }
}

/// The largest difference along a cube's edges [steps].
int BlockSurface::steps(int x, int y, int z) const {
  const auto corner = [&](unsigned i) {
    return int{value_[padded(x + static_cast<int>(i & 1U), y + static_cast<int>(i >> 1U & 1U),
                             z + static_cast<int>(i >> 2U))]};
  };
  int most = 0;
  for (const CubeEdge& edge : kCubeEdges)
    most = std::max(most, std::abs(corner(edge.from) - corner(edge.to)));
  return most;
}

std::uint16_t BlockSurface::newVertex(int axis, int x, int y, int z, SurfacePatch& patch) const {
  const std::array<int, 3> to = {x + (axis == 0 ? 1 : 0), y + (axis == 1 ? 1 : 0), z + (axis == 2 ? 1 : 0)};
  const auto a = static_cast<float>(value_[padded(x, y, z)]),
             b = static_cast<float>(value_[padded(to[0], to[1], to[2])]);
  const float share = std::clamp(a / (a - b), kEdgeMargin, 1 - kEdgeMargin);
  SurfaceVertex vertex;
  const std::array<int, 3> from = {x, y, z};
  const std::array<std::int32_t, 3> first = {block_.x * kBlockSide, block_.y * kBlockSide,
                                             block_.z * kBlockSide};
  for (std::size_t i = 0; i < 3; ++i) {
    const double voxels = static_cast<double>(first[i] + from[i]) + 0.5 +
                          (static_cast<int>(i) == axis ? static_cast<double>(share) : 0.0);
    vertex.p_world[static_cast<int>(i)] = static_cast<float>(voxels * volume_.settings().voxel_size);
  }
  Eigen::Vector3f normal = (1 - share) * gradient(x, y, z) + share * gradient(to[0], to[1], to[2]);
  const float length = normal.norm();
  if (length > 0) normal /= length;
  vertex.normal = {quantised(normal.x()), quantised(normal.y()), quantised(normal.z())};
  if (std::abs(a) <= std::abs(b)) {
    attributes(x, y, z, vertex);
  } else {
    attributes(to[0], to[1], to[2], vertex);
  }
  (void)patch.vertices.tryPushBack(vertex);
  return static_cast<std::uint16_t>(patch.vertices.size() - 1);
}

Eigen::Vector3f BlockSurface::gradient(int x, int y, int z) const {
  const std::size_t at = padded(x, y, z);
  constexpr std::array<std::size_t, 3> kStride = {1, kRow, static_cast<std::size_t>(kRow) * kPad};
  Eigen::Vector3f result;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int here = value_[at];
    const int before = value_[at - kStride[axis]], after = value_[at + kStride[axis]];
    // One-sided where a side was not observed.
    const bool has_before = before != kUnknown, has_after = after != kUnknown;
    const auto difference = static_cast<float>((has_after ? after : here) - (has_before ? before : here));
    result[static_cast<int>(axis)] = has_before && has_after ? 0.5F * difference : difference;
  }
  return result;
}

void BlockSurface::attributes(int x, int y, int z, SurfaceVertex& vertex) const {
  const std::uint32_t slot = neighbour_[neighbourAt(x >> kBlockBits, y >> kBlockBits, z >> kBlockBits)];
  const VoxelBlock* const block = volume_.voxels(slot);
  if (block == nullptr) return;
  const std::size_t at = offsetOf({x, y, z});
  vertex.grey = block->grey[at];
  const LabelBlock* const labels = volume_.labels(slot);
  if (labels == nullptr) return;
  const LabelEstimate estimate = confusion_.estimate(labels->counts[at]);
  vertex.label = estimate.label;
  vertex.probability = static_cast<std::uint8_t>(static_cast<int>(255 * estimate.probability + 0.5F));
}

}  // namespace swiftlet
