#include "mapping/surface/block_surface.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "mapping/surface/cube_cases.hpp"

namespace swiftlet {
namespace {

/// Of a voxel that was not observed; no distance is as large.
constexpr float kUnknown = 1e9F;
/// A vertex keeps this share of an edge from its ends, so that no triangle has a corner twice.
constexpr float kEdgeMargin = 1e-3F;

constexpr std::size_t neighbourAt(int x, int y, int z) {
  return static_cast<std::size_t>((x + 1) + 3 * ((y + 1) + 3 * (z + 1)));
}
constexpr std::size_t kSelf = neighbourAt(0, 0, 0);

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
                     ? static_cast<float>(settings.most_step) * volume.voxelSize() / volume.distanceStep()
                     : kUnknown) {}

/// False where all that the block's cubes touch lies on one side.
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
        sides = static_cast<std::uint8_t>(
            sides | (header.state == BlockState::kFree ? BlockHeader::kInFront : header.sides));
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

void BlockSurface::fillPadded() {
  // Of the padded range -1 to side + 1 along an axis: the part that each neighbour gives.
  struct Part {
    int first, last;
  };
  constexpr std::array<Part, 3> kParts = {{{-1, -1}, {0, kBlockSide - 1}, {kBlockSide, kBlockSide + 1}}};
  for (int nz = -1; nz <= 1; ++nz) {
    for (int ny = -1; ny <= 1; ++ny) {
      for (int nx = -1; nx <= 1; ++nx) {
        const std::uint32_t slot = neighbour_[neighbourAt(nx, ny, nz)];
        const VoxelBlock* const block = slot == VoxelVolume::kNone ? nullptr : volume_.voxels(slot);
        const float otherwise = slot == VoxelVolume::kNone ? kUnknown : kDistanceSteps;
        const Part px = kParts[static_cast<std::size_t>(nx + 1)],
                   py = kParts[static_cast<std::size_t>(ny + 1)],
                   pz = kParts[static_cast<std::size_t>(nz + 1)];
        for (int z = pz.first; z <= pz.last; ++z) {
          for (int y = py.first; y <= py.last; ++y) {
            float* const to = &value_[padded(px.first, y, z)];
            if (block == nullptr) {
              std::fill_n(to, px.last - px.first + 1, otherwise);
              continue;
            }
            const std::size_t from = offsetOf({px.first, y, z});
            for (int x = 0; x <= px.last - px.first; ++x) {
              const std::size_t at = from + static_cast<std::size_t>(x);
              to[x] = block->weight[at] >= least_weight_ ? static_cast<float>(block->distance[at]) : kUnknown;
            }
          }
        }
      }
    }
  }
}

void BlockSurface::extract(std::uint32_t slot, SurfacePatch& patch) {
  patch.block = volume_.header(slot).index;
  patch.vertices.clear();
  patch.triangles.clear();
  if (volume_.header(slot).state != BlockState::kVoxels || !gatherNeighbours(patch.block)) return;
  fillPadded();
  for (auto& edges : vertex_) edges.fill(kNoVertex);
  // Of each row of corners: which lie behind, which are known.
  std::array<std::array<std::uint32_t, kCorners>, kCorners> behind{}, known{};
  for (int z = 0; z < kCorners; ++z) {
    for (int y = 0; y < kCorners; ++y) {
      const float* const row = &value_[padded(0, y, z)];
      std::uint32_t b = 0, k = 0;
      for (unsigned x = 0; x < kCorners; ++x) {
        b |= (row[x] < 0 ? 1U : 0U) << x;
        k |= (row[x] < kUnknown ? 1U : 0U) << x;
      }
      behind[static_cast<std::size_t>(z)][static_cast<std::size_t>(y)] = b;
      known[static_cast<std::size_t>(z)][static_cast<std::size_t>(y)] = k;
    }
  }
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    for (std::size_t y = 0; y < kBlockSide; ++y) {
      const std::uint32_t any = behind[z][y] | behind[z][y + 1] | behind[z + 1][y] | behind[z + 1][y + 1];
      const std::uint32_t all = behind[z][y] & behind[z][y + 1] & behind[z + 1][y] & behind[z + 1][y + 1];
      const std::uint32_t seen = known[z][y] & known[z][y + 1] & known[z + 1][y] & known[z + 1][y + 1];
      std::uint32_t cubes =
          (any | (any >> 1U)) & ~(all & (all >> 1U)) & seen & (seen >> 1U) & ((1U << kBlockSide) - 1U);
      while (cubes != 0) {
        const int x = std::countr_zero(cubes);
        cubes &= cubes - 1;
        addCube(x, static_cast<int>(y), static_cast<int>(z), patch);
      }
    }
  }
}

void BlockSurface::addCube(int x, int y, int z, SurfacePatch& patch) {
  unsigned which = 0;
  std::array<float, 8> corner;
  for (unsigned i = 0; i < 8; ++i) {
    corner[i] = value_[padded(x + static_cast<int>(i & 1U), y + static_cast<int>(i >> 1U & 1U),
                              z + static_cast<int>(i >> 2U))];
    which |= (corner[i] < 0 ? 1U : 0U) << i;
  }
  const CubeCase& cube = kCubeCases[which];
  std::array<std::uint16_t, 12> vertex;
  vertex.fill(kNoVertex);
  if (most_step_ < kUnknown) {
    for (const CubeEdge& edge : kCubeEdges) {
      if (std::abs(corner[edge.from] - corner[edge.to]) > most_step_) return;
    }
  }
  for (std::size_t i = 0; i < std::size_t{3} * cube.triangles; ++i) {
    const std::uint8_t e = cube.edge[i];
    if (vertex[e] != kNoVertex) continue;
    const unsigned from = kCubeEdges[e].from;
    vertex[e] = vertexOn(kCubeEdges[e].axis, x + static_cast<int>(from & 1U),
                         y + static_cast<int>(from >> 1U & 1U), z + static_cast<int>(from >> 2U), patch);
  }
  for (std::size_t i = 0; i < cube.triangles; ++i) {
    const std::array<std::uint16_t, 3> corners = {vertex[cube.edge[3 * i]], vertex[cube.edge[3 * i + 1]],
                                                  vertex[cube.edge[3 * i + 2]]};
    if (!patch.triangles.tryPushBack(corners)) return;
  }
}

std::uint16_t BlockSurface::vertexOn(int axis, int x, int y, int z, SurfacePatch& patch) {
  std::uint16_t& known =
      vertex_[static_cast<std::size_t>(axis)][static_cast<std::size_t>(x + kCorners * (y + kCorners * z))];
  if (known != kNoVertex) return known;
  const std::array<int, 3> to = {x + (axis == 0 ? 1 : 0), y + (axis == 1 ? 1 : 0), z + (axis == 2 ? 1 : 0)};
  const float a = value_[padded(x, y, z)], b = value_[padded(to[0], to[1], to[2])];
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
  known = static_cast<std::uint16_t>(patch.vertices.size());
  (void)patch.vertices.tryPushBack(vertex);
  return known;
}

Eigen::Vector3f BlockSurface::gradient(int x, int y, int z) const {
  const std::size_t at = padded(x, y, z);
  constexpr std::array<std::size_t, 3> kStride = {1, kPad, static_cast<std::size_t>(kPad) * kPad};
  Eigen::Vector3f result;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float here = value_[at];
    const float before = value_[at - kStride[axis]], after = value_[at + kStride[axis]];
    // One-sided where a side was not observed.
    const bool has_before = before < kUnknown, has_after = after < kUnknown;
    const float difference = (has_after ? after : here) - (has_before ? before : here);
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
