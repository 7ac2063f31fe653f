#include "mapping/distance/volume_distance.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

// Flatter than this the distance does not say where its zero is [per voxel of 1].
constexpr float kLeastSlope = 0.3F;

constexpr std::array<VoxelIndex, 6> kFaces{
    {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};

Eigen::Vector3i cellOf(const VoxelIndex& voxel) { return {voxel.x, voxel.y, voxel.z}; }

BlockIndex blockFrom(std::uint64_t key) {
  const auto part = [key](unsigned shift) {
    return static_cast<std::int32_t>(key >> shift & 0x1FFFFFU) - (1 << 20);
  };
  return {part(0), part(21), part(42)};
}

/// From the block's first voxel on, one beyond each face too: what they hold depends on this block.
template <typename Visit>
void forVoxels(const BlockIndex& block, int border, const Visit& visit) {
  const VoxelIndex first{block.x * kBlockSide, block.y * kBlockSide, block.z * kBlockSide};
  const auto outside = [](int i) { return i < 0 || i >= kBlockSide ? 1 : 0; };
  for (int z = -border; z < kBlockSide + border; ++z) {
    for (int y = -border; y < kBlockSide + border; ++y) {
      for (int x = -border; x < kBlockSide + border; ++x) {
        if (outside(x) + outside(y) + outside(z) <= 1) visit(first + VoxelIndex{x, y, z});
      }
    }
  }
}

bool changesSign(float a, float b) { return (a < 0) != (b < 0); }

}  // namespace

VolumeDistance::VolumeDistance(const VoxelVolume& volume, DistanceField& field)
    : volume_(volume), field_(field), seen_(volume.slots()) {}

bool VolumeDistance::inWindow(const BlockIndex& block) const {
  const Eigen::Vector3i first = cellOf(block) * kBlockSide - field_.origin();
  return ((first.array() + kBlockSide) > 0).all() && (first.array() < field_.limits().cells.array()).all();
}

/// Blocks that were not wholly in the window before are read anew.
void VolumeDistance::forgetEntered(const Eigen::Vector3i& origin_before) {
  for (Seen& seen : seen_) {
    if (seen.key == 0) continue;
    const Eigen::Vector3i first = cellOf(blockFrom(seen.key)) * kBlockSide - origin_before;
    const bool was_inside =
        (first.array() >= 0).all() && ((first.array() + kBlockSide) <= field_.limits().cells.array()).all();
    if (!was_inside) seen = {};
  }
}

void VolumeDistance::step(const Eigen::Vector3d& p_map_vehicle, const DistanceEffort& effort,
                          DistanceStep& out) {
  out = {};
  const Eigen::Vector3i origin = field_.origin();
  if (field_.follow(p_map_vehicle)) forgetEntered(origin);
  const auto slots = static_cast<std::uint32_t>(seen_.size());
  std::uint32_t visited = 0;
  for (; visited < slots && out.blocks < effort.blocks; ++visited) {
    const std::uint32_t slot = cursor_;
    cursor_ = cursor_ + 1 < slots ? cursor_ + 1 : 0;
    const BlockHeader& header = volume_.header(slot);
    const bool used = header.state != BlockState::kUnused;
    const Seen now{used ? keyOf(header.index) : 0, used ? header.revision : 0};
    Seen& seen = seen_[slot];
    if (seen.key == now.key && (now.key == 0 || seen.revision == now.revision)) continue;
    const bool dropped = seen.key != 0 && seen.key != now.key;
    const bool shown = used && inWindow(header.index);
    if (dropped) erase(seen.key);
    if (shown) read(slot);
    seen = shown || !used ? now : Seen{};
    if (dropped || shown) ++out.blocks;
  }
  out.cells = field_.propagate(effort.cells);
  out.caught_up = visited == slots && field_.queued() == 0;
}

void VolumeDistance::erase(std::uint64_t key) {
  // It may stand elsewhere in the volume by now, or have come back.
  const BlockIndex block = blockFrom(key);
  if (volume_.find(block) != VoxelVolume::kNone) return;
  forVoxels(block, 0, [this](const VoxelIndex& voxel) { field_.setSpace(cellOf(voxel), Space::kUnknown); });
}

void VolumeDistance::read(std::uint32_t slot) {
  const BlockHeader& header = volume_.header(slot);
  if (header.state == BlockState::kFree) {
    forVoxels(header.index, 0,
              [this](const VoxelIndex& voxel) { field_.setSpace(cellOf(voxel), Space::kFree); });
    return;
  }
  gatherAround(header.index);
  forVoxels(header.index, 1, [this](const VoxelIndex& voxel) { readVoxel(voxel); });
}

void VolumeDistance::gatherAround(const BlockIndex& block) {
  block_ = block;
  std::size_t i = 0;
  for (int z = -1; z <= 1; ++z) {
    for (int y = -1; y <= 1; ++y) {
      for (int x = -1; x <= 1; ++x) around_[i++] = volume_.find(block + BlockIndex{x, y, z});
    }
  }
}

/// VoxelVolume::distanceAt without a search: `voxel` lies in the block in hand or beside it.
bool VolumeDistance::valueAt(const VoxelIndex& voxel, float& distance) const {
  const BlockIndex at = blockOf(voxel);
  const int which = at.x - block_.x + 1 + 3 * (at.y - block_.y + 1) + 9 * (at.z - block_.z + 1);
  const std::uint32_t slot = around_[static_cast<std::size_t>(which)];
  if (slot == VoxelVolume::kNone) return false;
  const VoxelBlock* voxels = volume_.voxels(slot);
  if (voxels == nullptr) {
    distance = static_cast<float>(volume_.settings().truncation);
    return true;
  }
  const std::size_t within = offsetOf(voxel);
  distance = volume_.distanceStep() * static_cast<float>(voxels->distance[within]);
  return voxels->weight[within] > 0;
}

void VolumeDistance::readVoxel(const VoxelIndex& voxel) {
  float own = 0;
  if (!valueAt(voxel, own)) {
    field_.setSpace(cellOf(voxel), Space::kUnknown);
    return;
  }
  std::array<float, 6> beside{};
  std::array<bool, 6> known{};
  bool crossed = false;
  for (std::size_t i = 0; i < kFaces.size(); ++i) {
    known[i] = valueAt(voxel + kFaces[i], beside[i]);
    crossed = crossed || (known[i] && changesSign(own, beside[i]) && std::abs(own) <= std::abs(beside[i]));
  }
  const Space space = own < 0 ? Space::kBehindSurface : Space::kFree;
  if (!crossed) {
    field_.setSpace(cellOf(voxel), space);
    return;
  }
  Eigen::Vector3f slope = Eigen::Vector3f::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    const auto after = static_cast<std::size_t>(2 * axis);
    const std::size_t before = after + 1;
    const float high = known[after] ? beside[after] : own;
    const float low = known[before] ? beside[before] : own;
    const float span = static_cast<float>(static_cast<int>(known[after]) + static_cast<int>(known[before]));
    if (span > 0) slope[axis] = (high - low) / (span * volume_.voxelSize());
  }
  const float squared = slope.squaredNorm();
  Eigen::Vector3f offset = Eigen::Vector3f::Zero();
  if (squared > kLeastSlope * kLeastSlope) offset = -own / (squared * volume_.voxelSize()) * slope;
  field_.setSurface(cellOf(voxel), space, offset.cwiseMax(-1.0F).cwiseMin(1.0F));
}

}  // namespace swiftlet
