#include "mapping/distance/volume_distance.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace swiftlet {
namespace {

constexpr std::uint32_t kWholeRow = (1U << kBlockSide) - 1;
static_assert(kBlockSide == kDistanceStep, "a block lies in the window whole or not at all");

constexpr std::array<VoxelIndex, 6> kFaces{
    {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};

Eigen::Vector3i cellOf(const VoxelIndex& voxel) { return {voxel.x, voxel.y, voxel.z}; }

BlockIndex blockFrom(std::uint64_t key) {
  const auto part = [key](unsigned shift) {
    return static_cast<std::int32_t>(key >> shift & 0x1FFFFFU) - (1 << 20);
  };
  return {part(0), part(21), part(42)};
}

Eigen::Vector3i firstCell(const BlockIndex& block) { return cellOf(block) * kBlockSide; }

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

void VolumeDistance::step(Stamp newest, const Eigen::Vector3d& p_map_vehicle, const DistanceEffort& effort,
                          DistanceStep& out) {
  out = {};
  field_.announce(newest);
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
  out.caught_up = visited == slots;
  if (out.caught_up) up_to_ = newest;
  field_.update(up_to_);
}

void VolumeDistance::erase(std::uint64_t key) {
  // It may stand elsewhere in the volume by now, or have come back.
  const BlockIndex block = blockFrom(key);
  if (volume_.find(block) == VoxelVolume::kNone) fill(block, Space::kUnknown);
}

void VolumeDistance::fill(const BlockIndex& block, Space space) {
  std::array<Space, kBlockSide> row;
  row.fill(space);
  for (int z = 0; z < kBlockSide; ++z) {
    for (int y = 0; y < kBlockSide; ++y)
      field_.setSpaces(firstCell(block) + Eigen::Vector3i(0, y, z), kWholeRow, row);
  }
}

void VolumeDistance::read(std::uint32_t slot) {
  const BlockHeader& header = volume_.header(slot);
  if (header.state == BlockState::kFree) {
    fill(header.index, Space::kFree);
    return;
  }
  gatherAround(header.index);
  gatherValues();
  const VoxelIndex first{header.index.x * kBlockSide, header.index.y * kBlockSide,
                         header.index.z * kBlockSide};
  for (int z = 0; z < kBlockSide; ++z) {
    for (int y = 0; y < kBlockSide; ++y) readRow(first + VoxelIndex{0, y, z}, y, z);
  }
  readBorder(first);
}

/// Distances of the block and one voxel beyond each face, by sign: 1 in front, -1 behind, 0 not observed.
void VolumeDistance::gatherValues() {
  sign_.fill(0);
  const auto signsOf = [this](const BlockIndex& beside, int from, int to, const auto& place) {
    const std::uint32_t slot = around_[static_cast<std::size_t>(13 + beside.x + 3 * beside.y + 9 * beside.z)];
    if (slot == VoxelVolume::kNone) return;
    const VoxelBlock* const voxels = volume_.voxels(slot);
    for (int i = from; i < to; ++i) {
      const VoxelIndex voxel = place(i);
      const std::size_t within = offsetOf(voxel);
      const bool seen = voxels == nullptr || voxels->weight[within] > 0;
      const bool behind = voxels != nullptr && voxels->distance[within] < 0;
      sign_[signAt(voxel.x, voxel.y, voxel.z)] = static_cast<std::int8_t>(!seen ? 0 : behind ? -1 : 1);
    }
  };
  constexpr int kFace = kBlockSide * kBlockSide;
  const auto low = [](int i) { return i & kBlockMask; };
  const auto high = [](int i) { return i >> kBlockBits; };
  signsOf({}, 0, static_cast<int>(kBlockVoxels), [&](int i) {
    return VoxelIndex{low(i), low(high(i)), high(high(i))};
  });
  for (const int side : {-1, 1}) {
    const int at = side < 0 ? -1 : kBlockSide;
    signsOf({side, 0, 0}, 0, kFace, [&](int i) { return VoxelIndex{at, low(i), high(i)}; });
    signsOf({0, side, 0}, 0, kFace, [&](int i) { return VoxelIndex{low(i), at, high(i)}; });
    signsOf({0, 0, side}, 0, kFace, [&](int i) { return VoxelIndex{low(i), high(i), at}; });
  }
}

/// Eight voxels: those beside one of the other sign by themselves, the others as a row.
void VolumeDistance::readRow(const VoxelIndex& first, int y, int z) {
  const std::int8_t* const own = &sign_[signAt(0, y, z)];
  constexpr std::array<int, 6> kBeside = {
      1, -1, kSignRow, -kSignRow, kSignRow * kSignSide, -kSignRow * kSignSide};
  std::array<Space, kBlockSide> space;
  std::uint32_t crossed = 0;
  for (int x = 0; x < kBlockSide; ++x) {
    int other = 0;
    for (const int beside : kBeside) other |= own[x] * own[x + beside];
    crossed |= (other < 0 ? 1U : 0U) << static_cast<unsigned>(x);
    space[static_cast<std::size_t>(x)] = own[x] == 0  ? Space::kUnknown
                                         : own[x] < 0 ? Space::kBehindSurface
                                                      : Space::kFree;
  }
  field_.setSpaces(cellOf(first), kWholeRow & ~crossed, space);
  for (; crossed != 0; crossed &= crossed - 1) readVoxel(first + VoxelIndex{std::countr_zero(crossed), 0, 0});
}

/// One voxel beyond each face: what it holds depends on this block where surface passes between the two, or
/// did.
void VolumeDistance::readBorder(const VoxelIndex& first) {
  const auto look = [&](int x, int y, int z, int inner_x, int inner_y, int inner_z) {
    const VoxelIndex voxel = first + VoxelIndex{x, y, z};
    const bool crossed = sign_[signAt(x, y, z)] * sign_[signAt(inner_x, inner_y, inner_z)] < 0;
    if (crossed || field_.holdsSurface(cellOf(voxel))) readVoxel(voxel);
  };
  for (const int side : {-1, 1}) {
    const int outer = side < 0 ? -1 : kBlockSide, inner = side < 0 ? 0 : kBlockSide - 1;
    for (int j = 0; j < kBlockSide; ++j) {
      for (int i = 0; i < kBlockSide; ++i) {
        look(outer, i, j, inner, i, j);
        look(i, outer, j, i, inner, j);
        look(i, j, outer, i, j, inner);
      }
    }
  }
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
  // Slopes [per voxel]: across the surface, of both sides' size where it passes on both; else from one side
  // to the other.
  Eigen::Vector3f slope = Eigen::Vector3f::Zero();
  SurfacePoint point;
  for (int axis = 0; axis < 3; ++axis) {
    const auto after = static_cast<std::size_t>(2 * axis);
    const std::size_t before = after + 1;
    const float rise = known[after] ? beside[after] - own : 0;
    const float fall = known[before] ? own - beside[before] : 0;
    const bool crossed_after = known[after] && changesSign(own, beside[after]);
    const bool crossed_before = known[before] && changesSign(own, beside[before]);
    if (crossed_after && crossed_before) {
      point.both_sides[static_cast<std::size_t>(axis)] = true;
      slope[axis] = (rise - fall) / 2;
    } else if (crossed_after || crossed_before) {
      slope[axis] = crossed_after ? rise : fall;
    } else {
      slope[axis] = (rise + fall) / (known[after] && known[before] ? 2.0F : 1.0F);
    }
  }
  point.offset = (-own / slope.squaredNorm() * slope).cwiseMax(-kMostOffset).cwiseMin(kMostOffset);
  field_.setSurface(cellOf(voxel), space, point);
}

}  // namespace swiftlet
