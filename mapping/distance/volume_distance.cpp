#include "mapping/distance/volume_distance.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

namespace swiftlet {
namespace {

static_assert(kBlockSide == kDistanceStep, "a block lies in the window whole or not at all");

constexpr float kUnseen = std::numeric_limits<float>::quiet_NaN();

constexpr std::array<BlockIndex, 6> kFaces{
    {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};

Eigen::Vector3i firstCell(const BlockIndex& block) {
  return Eigen::Vector3i(block.x, block.y, block.z) * kBlockSide;
}

/// Whether surface passes between two voxels.
bool crossed(float own, float beside) { return !std::isnan(beside) && (own < 0) != (beside < 0); }

}  // namespace

VolumeDistance::VolumeDistance(const VoxelVolume& volume, DistanceField& field)
    : volume_(volume), field_(field), seen_(volume.slots()), waits_(volume.slots()) {}

bool VolumeDistance::inWindow(const BlockIndex& block, const Eigen::Vector3i& origin) const {
  const Eigen::Vector3i first = firstCell(block) - origin;
  return (first.array() >= 0).all() && (first.array() < field_.limits().cells.array()).all();
}

void VolumeDistance::step(Stamp newest, const Eigen::Vector3d& p_map_vehicle, const DistanceEffort& effort,
                          DistanceStep& out) {
  out = {};
  // Announce a stamp only once: since then, the caller may have announced a newer image that is not fused.
  if (newest != newest_) field_.announce(newest);
  newest_ = newest;
  const Eigen::Vector3i origin = field_.origin();
  if (field_.follow(p_map_vehicle)) {
    // Read again the blocks that were not in the window before.
    for (Seen& seen : seen_) {
      if (seen.key != 0 && !inWindow(indexFrom(seen.key), origin)) seen = {};
    }
  }
  findChanges();
  const auto slots = static_cast<std::uint32_t>(seen_.size());
  for (std::uint32_t visited = 0; waiting_ > 0 && visited < slots && out.blocks < effort.blocks; ++visited) {
    const std::uint32_t slot = cursor_;
    cursor_ = cursor_ + 1 < slots ? cursor_ + 1 : 0;
    if (waits_[slot] == 0) continue;
    waits_[slot] = 0;
    --waiting_;
    read(slot);
    ++out.blocks;
  }
  out.caught_up = waiting_ == 0;
  if (out.caught_up) up_to_ = newest;
  field_.update(up_to_);
}

void VolumeDistance::findChanges() {
  for (std::uint32_t slot = 0; slot < seen_.size(); ++slot) {
    const BlockHeader& header = volume_.header(slot);
    const bool shown = header.state != BlockState::kUnused && inWindow(header.index, field_.origin());
    const Seen now = shown ? Seen{keyOf(header.index), header.revision} : Seen{};
    Seen& seen = seen_[slot];
    if (seen.key == now.key && seen.revision == now.revision) continue;
    if (seen.key != 0 && seen.key != now.key) {
      // The dropped block may be in the volume again, in another slot.
      const BlockIndex dropped = indexFrom(seen.key);
      if (volume_.find(dropped) == VoxelVolume::kNone) fill(dropped, 0);
      askAround(dropped);
    }
    if (shown) {
      ask(slot);
      askAround(header.index);
    }
    seen = now;
  }
}

void VolumeDistance::ask(std::uint32_t slot) {
  waiting_ += waits_[slot] == 0 ? 1U : 0U;
  waits_[slot] = 1;
}

/// Marks the face neighbours for reading: surface in their outer voxels depends on this block.
void VolumeDistance::askAround(const BlockIndex& block) {
  for (const BlockIndex& face : kFaces) {
    const std::uint32_t slot = volume_.find(block + face);
    if (slot != VoxelVolume::kNone && volume_.voxels(slot) != nullptr) ask(slot);
  }
}

void VolumeDistance::fill(const BlockIndex& block, std::uint64_t free_parts) {
  std::array<Space, kBlockSide> row;
  for (int z = 0; z < kBlockSide; ++z) {
    for (int y = 0; y < kBlockSide; ++y) {
      for (int x = 0; x < kBlockSide; ++x) {
        const bool free = (free_parts & partBit(x / kPartVoxels, y / kPartVoxels, z / kPartVoxels)) != 0;
        row[static_cast<std::size_t>(x)] = free ? Space::kFree : Space::kUnknown;
      }
      field_.setSpaces(firstCell(block) + Eigen::Vector3i(0, y, z), kWholeRow, row);
    }
  }
}

void VolumeDistance::read(std::uint32_t slot) {
  const BlockHeader& header = volume_.header(slot);
  if (header.state == BlockState::kUnused) return;
  if (header.state == BlockState::kFree) {
    fill(header.index, header.free_parts);
    return;
  }
  gather(slot);
  for (int z = 0; z < kBlockSide; ++z) {
    for (int y = 0; y < kBlockSide; ++y) readRow(firstCell(header.index) + Eigen::Vector3i(0, y, z), y, z);
  }
}

/// Distances of the block and of one voxel beyond each face.
void VolumeDistance::gather(std::uint32_t slot) {
  const BlockIndex block = volume_.header(slot).index;
  value_.fill(kUnseen);
  const auto take = [this](std::uint32_t from, const BlockIndex& beside) {
    const VoxelBlock* const voxels = volume_.voxels(from);
    // Only the touching layer of a neighbour is needed.
    const auto range = [](int side) {
      return side == 0  ? std::pair{0, kBlockSide}
             : side < 0 ? std::pair{kBlockSide - 1, kBlockSide}
                        : std::pair{0, 1};
    };
    const auto [x0, x1] = range(beside.x);
    const auto [y0, y1] = range(beside.y);
    const auto [z0, z1] = range(beside.z);
    for (int z = z0; z < z1; ++z) {
      for (int y = y0; y < y1; ++y) {
        for (int x = x0; x < x1; ++x) {
          const auto at = static_cast<std::size_t>(x + kBlockSide * (y + kBlockSide * z));
          float& value = value_[placeOf(x + kBlockSide * beside.x, y + kBlockSide * beside.y,
                                        z + kBlockSide * beside.z)];
          if (voxels == nullptr) {
            value = static_cast<float>(volume_.settings().truncation);
          } else if (voxels->weight[at] > 0) {
            value = volume_.distanceStep() * static_cast<float>(voxels->distance[at]);
          }
        }
      }
    }
  };
  take(slot, {});
  for (const BlockIndex& face : kFaces) {
    const std::uint32_t beside = volume_.find(block + face);
    if (beside != VoxelVolume::kNone) take(beside, face);
  }
}

/// Sets eight voxels: those with surface one by one, the others as a row.
void VolumeDistance::readRow(const Eigen::Vector3i& first, int y, int z) {
  std::array<Space, kBlockSide> space;
  std::uint32_t holding = 0;
  for (int x = 0; x < kBlockSide; ++x) {
    const float* const own = &value_[placeOf(x, y, z)];
    bool holds = false;
    for (const int step : kSteps) {
      for (const float beside : {own[step], own[-step]})
        holds = holds || (crossed(*own, beside) && std::abs(*own) <= std::abs(beside));
    }
    holding |= holds ? 1U << static_cast<unsigned>(x) : 0U;
    space[static_cast<std::size_t>(x)] = std::isnan(*own) ? Space::kUnknown
                                         : *own < 0       ? Space::kBehindSurface
                                                          : Space::kFree;
  }
  field_.setSpaces(first, kWholeRow & ~holding, space);
  for (; holding != 0; holding &= holding - 1) {
    const int x = std::countr_zero(holding);
    field_.setSurface(first + Eigen::Vector3i(x, 0, 0), space[static_cast<std::size_t>(x)],
                      surfaceAt(&value_[placeOf(x, y, z)]));
  }
}

/// The zero of a plane with the slopes of the distance [m per voxel]. Along an axis the slope is taken across
/// the surface. If the surface passes on both sides, it is the mean size of both; if on none, the central
/// difference (one-sided beside unobserved voxels).
CellSurface VolumeDistance::surfaceAt(const float* own) {
  CellSurface point;
  Eigen::Vector3f slope = Eigen::Vector3f::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    const float after = own[kSteps[static_cast<std::size_t>(axis)]];
    const float before = own[-kSteps[static_cast<std::size_t>(axis)]];
    const float rise = std::isnan(after) ? 0 : after - *own;
    const float fall = std::isnan(before) ? 0 : *own - before;
    const bool crossed_after = crossed(*own, after), crossed_before = crossed(*own, before);
    if (crossed_after && crossed_before) {
      point.both_sides[static_cast<std::size_t>(axis)] = true;
      slope[axis] = (rise - fall) / 2;
    } else if (crossed_after || crossed_before) {
      slope[axis] = crossed_after ? rise : fall;
    } else {
      slope[axis] = (rise + fall) / (std::isnan(after) || std::isnan(before) ? 1.0F : 2.0F);
    }
  }
  point.offset = -*own / slope.squaredNorm() * slope;
  return point;
}

}  // namespace swiftlet
