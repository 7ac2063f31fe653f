#include "mapping/map/map_submaps.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

/// How far images fused into one block may disagree, and how far a block may be out of place [voxels].
constexpr double kMixedVoxels = 0.1;
constexpr double kOutOfPlaceVoxels = 0.5;
/// A new pass over the stored blocks begins after the vehicle has moved this far [m].
constexpr double kPassStep = 1;
/// Records looked at in one step: 1 ms.
constexpr std::size_t kMostRecords = std::size_t{1} << 16U;
/// A block turned by any angle reaches at most kBlockReach blocks beyond the one with its centre. The surface
/// of a tile needs kTileMargin more blocks on each side.
constexpr int kBlockReach = 1, kTileMargin = 1;

struct InTile {
  std::uint64_t tile = 0;  ///< its key
  SubmapId submap = 0;     ///< first to last
  bool in_volume = false;
  std::uint32_t at = 0;  ///< slot, or record
  auto operator<=>(const InTile&) const = default;
};

BlockIndex blockAt(const Eigen::Vector3d& p_map, double block_size) {
  const Eigen::Vector3d b = (p_map / block_size).array().floor();
  return {static_cast<std::int32_t>(b.x()), static_cast<std::int32_t>(b.y()),
          static_cast<std::int32_t>(b.z())};
}

BlockIndex tileOf(const BlockIndex& block) {
  const auto along = [](std::int32_t b) {
    return static_cast<std::int32_t>(std::floor(static_cast<double>(b) / MapSubmaps::kTileSide));
  };
  return {along(block.x), along(block.y), along(block.z)};
}

BlockIndex moved(const BlockIndex& block, int by) { return block + BlockIndex{by, by, by}; }

}  // namespace

MapSubmaps::MapSubmaps(VoxelVolume& volume, BlockStorage* storage, MapPoses poses,
                       const Eigen::Vector3d& half_box)
    : volume_(volume),
      submaps_(poses, kMixedVoxels * volume.settings().voxel_size),
      stored_(volume.settings(), storage,
              [this](SubmapId a, SubmapId b, const BlockIndex& block) { return agree(a, b, block); }),
      hints_(volume),
      half_box_(half_box) {
  leaving_.reserve(volume.slots());
  shown_.reserve(Submaps::kMost);
  static_cast<void>(volume.addListener(this));
}

std::size_t MapSubmaps::bytes() const {
  return sizeof(*this) + submaps_.bytes() + stored_.bytes() + leaving_.capacity() * sizeof(std::uint32_t) +
         Submaps::kMost * sizeof(SE3);
}

Eigen::Vector3d MapSubmaps::placeOf(const BlockIndex& block, SubmapId id) const {
  const Submap& submap = submaps_[id];
  const Eigen::Vector3d centre = volume_.centreOf(block).cast<double>();
  return submap.hasMoved() ? submap.motion() * centre : centre;
}

bool MapSubmaps::follow(const Submap& image) {
  if (submaps_.follow(image)) {
    volume_.beginSubmap(submaps_.newest(), submaps_.staleBefore(), submaps_.outdated());
    shown_.push_back(image.T_map_world);
  }
  const Eigen::Vector3d p_map_vehicle = image.T_map_world * image.T_world_body.translation;
  if ((p_map_vehicle - p_map_pass_).norm() > kPassStep) {
    p_map_pass_ = p_map_vehicle;
    cursor_ = 0;
  }
  return submaps_.takes(image.epoch);
}

bool MapSubmaps::addKept(const Submap& submap) {
  if (!submaps_.addKept(submap)) return false;
  shown_.push_back(submap.T_map_world);
  return true;
}

void MapSubmaps::correct(std::span<const WorldInMap> worlds) {
  const Submaps::Correction correction = submaps_.correct(worlds);
  if (!correction.moved && !correction.tied) return;
  leaving_.clear();
  const double most = kOutOfPlaceVoxels * volume_.settings().voxel_size;
  for (std::uint32_t slot = 0; slot < volume_.slots(); ++slot) {
    const BlockHeader& header = volume_.header(slot);
    if (header.state == BlockState::kUnused || !submaps_[header.submap].hasMoved()) continue;
    const Eigen::Vector3d centre = volume_.centreOf(header.index).cast<double>();
    if ((submaps_[header.submap].motion() * centre - centre).norm() > most) leaving_.push_back(slot);
  }
  counters_.blocks_moved += leaving_.size();
  volume_.remove(leaving_);
  bool any = !leaving_.empty() || correction.tied;
  for (std::size_t i = 0; i < submaps_.size(); ++i) {
    if (Submaps::shift(submaps_[i], shown_[i]) <= most) continue;
    shown_[i] = submaps_[i].T_map_world;
    any = true;
  }
  if (!any) return;
  ++counters_.corrections;
  layHintsAnew();
}

/// Removes all hints, for step() to return them: hints do not know their submap, and those in blocks that
/// left the volume are lost.
void MapSubmaps::layHintsAnew() {
  leaving_.clear();
  for (std::uint32_t slot = 0; slot < volume_.slots(); ++slot) {
    if (volume_.header(slot).isHint()) leaving_.push_back(slot);
  }
  volume_.remove(leaving_);
  for (std::size_t i = 0; i < stored_.size(); ++i) stored_.setShown(i, false);
  cursor_ = 0;
}

/// Whether two submaps have not moved relative to each other at a block since they were fused.
bool MapSubmaps::agree(SubmapId a, SubmapId b, const BlockIndex& block) const {
  if (submaps_[a].epoch != submaps_[b].epoch) return false;
  if (!submaps_[a].hasMoved() && !submaps_[b].hasMoved()) return true;
  const Eigen::Vector3d centre = volume_.centreOf(block).cast<double>();
  return (submaps_[a].motion() * centre - submaps_[b].motion() * centre).norm() <=
         kMixedVoxels * volume_.settings().voxel_size;
}

void MapSubmaps::step(const Eigen::Vector3d& p_map_vehicle, const CorrectionEffort& effort,
                      CorrectionStep& out) {
  out = {};
  volume_.beginChange();
  const std::size_t end = std::min(cursor_ + kMostRecords, stored_.size());
  for (; cursor_ < end && out.blocks < effort.blocks; ++cursor_) {
    const StoredBlocks::Record& record = stored_[cursor_];
    const Eigen::Vector3d centre = placeOf(record.index, record.submap);
    const Eigen::Array3d away = (centre - p_map_vehicle).array().abs() - half_box_.array();
    if ((away > half_box_.array()).any()) stored_.setShown(cursor_, false);
    if ((away > 0).any() || record.shown || !submaps_.isInMap(record.submap)) continue;
    stored_.setShown(cursor_, true);
    if (!stored_.read(cursor_, scratch_)) continue;
    hints_.hint(scratch_, submaps_[record.submap].motion(), p_map_vehicle.cast<float>());
    ++out.blocks;
  }
  counters_.blocks_back += out.blocks;
  out.done = !busy();
}

void MapSubmaps::beforeRemoval(const VoxelVolume& volume, std::span<const std::uint32_t> slots) {
  for (const std::uint32_t slot : slots) stored_.put(volume, slot);
}

void MapSubmaps::beforeRenewal(const VoxelVolume& volume, std::uint32_t slot) {
  const std::size_t before = stored_.size();
  stored_.put(volume, slot);
  // The block stays in the volume as a hint.
  if (stored_.size() > before) stored_.setShown(before, true);
}

void MapSubmaps::take(const BlockIndex& index, const VoxelBlock& voxels, const LabelBlock* labels) {
  ++counters_.blocks_apart;
  scratch_.index = index;
  scratch_.submap = submaps_.newest();
  scratch_.free_parts = 0;
  scratch_.voxels = voxels;
  scratch_.setLabels(labels);
  stored_.put(scratch_);
}

void MapSubmaps::storeAll() {
  for (std::uint32_t slot = 0; slot < volume_.slots(); ++slot) stored_.put(volume_, slot);
  for (std::size_t i = 0; i < stored_.size(); ++i) stored_.setShown(i, false);
}

void MapSubmaps::visitWhole(
    const std::function<bool(const Submap&)>& wanted,
    const std::function<void(const VoxelVolume&, std::span<const std::uint32_t> slots)>& take) {
  const double block_size = volume_.settings().voxel_size * kBlockSide;
  std::vector<InTile> parts;
  const auto list = [&](const BlockIndex& block, SubmapId submap, bool in_volume, std::uint32_t number) {
    if (!wanted(submaps_[submap])) return;
    const BlockIndex at = blockAt(placeOf(block, submap), block_size);
    const BlockIndex low = tileOf(moved(at, -kBlockReach - kTileMargin));
    const BlockIndex high = tileOf(moved(at, kBlockReach + kTileMargin));
    for (std::int32_t z = low.z; z <= high.z; ++z) {
      for (std::int32_t y = low.y; y <= high.y; ++y) {
        for (std::int32_t x = low.x; x <= high.x; ++x)
          parts.push_back({keyOf({x, y, z}), submap, in_volume, number});
      }
    }
  };
  for (std::uint32_t i = 0; i < stored_.size(); ++i) list(stored_[i].index, stored_[i].submap, false, i);
  for (std::uint32_t slot = 0; slot < volume_.slots(); ++slot) {
    const BlockHeader& header = volume_.header(slot);
    if (header.state != BlockState::kUnused) list(header.index, header.submap, true, slot);
  }
  if (parts.empty()) return;
  std::sort(parts.begin(), parts.end());
  VolumeSettings settings = volume_.settings();
  constexpr std::size_t kSide = kTileSide + 2 * kTileMargin;
  settings.memory_bytes = VoxelVolume::bytesFor(kSide * kSide * kSide, settings.labels);
  VoxelVolume tile(settings);
  BlockBlend blend(tile);
  std::vector<std::uint32_t> slots;
  for (auto part = parts.begin(); part != parts.end();) {
    const BlockIndex index = indexFrom(part->tile);
    const BlockIndex low{kTileSide * index.x, kTileSide * index.y, kTileSide * index.z};
    const BlockRange inner{low, moved(low, kTileSide - 1)};
    const BlockRange outer{moved(inner.low, -kTileMargin), moved(inner.high, kTileMargin)};
    tile.clear();
    tile.beginChange();
    const auto end = std::find_if(part, parts.end(), [&](const InTile& p) { return p.tile != part->tile; });
    const auto read = [this](const InTile& p) {
      return p.in_volume ? StoredBlocks::gather(volume_, p.at, scratch_) : stored_.read(p.at, scratch_);
    };
    for (auto p = part; p != end; ++p) {
      if (read(*p)) blend.add(scratch_, submaps_[p->submap].motion(), outer);
    }
    // Free space without voxels bounds surfaces as voxels do.
    blend.beginFree(outer);
    for (; part != end; ++part) {
      const bool is_free =
          part->in_volume ? volume_.header(part->at).state == BlockState::kFree : stored_[part->at].is_free;
      if (is_free && read(*part)) blend.addFree(scratch_, submaps_[part->submap].motion());
    }
    blend.endFree();
    slots.clear();
    for (std::uint32_t slot = 0; slot < tile.slots(); ++slot) {
      const BlockHeader& header = tile.header(slot);
      if (header.state != BlockState::kUnused && inner.holds(header.index)) slots.push_back(slot);
    }
    take(tile, slots);
  }
}

VoxelVolume MapSubmaps::wholeVolume(const std::function<bool(const Submap&)>& wanted) {
  std::size_t blocks = 1, free = 0;
  visitWhole(wanted, [&](const VoxelVolume& tile, std::span<const std::uint32_t> slots) {
    for (const std::uint32_t slot : slots) ++(tile.voxels(slot) != nullptr ? blocks : free);
  });
  VolumeSettings settings = volume_.settings();
  settings.memory_bytes =
      VoxelVolume::bytesFor(std::max(blocks, free / VoxelVolume::kFreePerBlock + 1), settings.labels);
  VoxelVolume whole(settings);
  whole.beginChange();
  visitWhole(wanted, [&](const VoxelVolume& tile, std::span<const std::uint32_t> slots) {
    for (const std::uint32_t slot : slots) whole.copy(tile, slot);
  });
  return whole;
}

}  // namespace swiftlet
