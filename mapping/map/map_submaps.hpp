#pragma once
// Corrects the volume when loop closure moves submaps, and moves blocks between volume and storage.
//
// A block goes to the storage if the volume drops it, if its submap moves by more than half a voxel at the
// block, or if an image sees it again after a time or after a correction (VoxelVolume::touch). No block thus
// mixes images that disagree. Stored blocks belong to their submap. Step by step, blocks in the box around
// the vehicle and in its frame return as hints, for the distance field and a depth sensor's surface, until an
// image shows them again. visitWhole() overlays all blocks at their corrected poses: the map as if it had
// been fused from the corrected poses, except for motion within a submap.
//
// Frames: map, metres. Memory: Submaps, StoredBlocks and 4 bytes a block of the volume, reserved at
// construction; visitWhole() allocates a volume of kTileSide^3 blocks. Cost: correct() passes over the
// volume's blocks and stores those that leave (5 us each); a step costs that of its blocks. No clock;
// deterministic. The idea is voxgraph's (Reijgwart et al., RA-L 2020), whose submaps are separate volumes.

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "mapping/map/block_blend.hpp"
#include "mapping/map/stored_blocks.hpp"
#include "mapping/map/submaps.hpp"
#include "mapping/volume/volume_integrator.hpp"
#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

struct CorrectionEffort {
  std::uint32_t blocks = 200;  ///< returned to the volume per step

  bool operator==(const CorrectionEffort&) const = default;
};

struct CorrectionStep {
  std::uint32_t blocks = 0;  ///< returned to the volume
  bool done = true;          ///< all blocks near the vehicle are in the volume
};

struct SubmapCounters {
  std::uint64_t corrections = 0;   ///< corrections that moved a submap
  std::uint64_t blocks_moved = 0;  ///< blocks that left the volume because their submap moved
  std::uint64_t blocks_back = 0;   ///< blocks that returned as hints
  std::uint64_t blocks_apart = 0;  ///< blocks of an image stored directly, because the volume had no room
};

class MapSubmaps : public BlockListener, public BlockOverflow {
 public:
  /// Edge of a tile of visitWhole(), in blocks.
  static constexpr int kTileSide = 16;

  /// `volume` and `storage` must outlive this object; `storage` may be null (StoredBlocks). Adds itself to
  /// the volume's listeners. `half_box` [m]: half extent of the box around the vehicle into which blocks
  /// return.
  MapSubmaps(VoxelVolume& volume, BlockStorage* storage, MapPoses poses, const Eigen::Vector3d& half_box);
  MapSubmaps(const MapSubmaps&) = delete;
  MapSubmaps& operator=(const MapSubmaps&) = delete;

  /// Call before an image is fused. `image` is the anchor of the submap that may begin with it. False: the
  /// image must not be fused (Submaps::takes()).
  bool follow(const Submap& image);
  /// Submaps::correct(), and corrects the volume.
  void correct(std::span<const WorldInMap> worlds);
  [[nodiscard]] bool busy() const { return cursor_ < stored_.size(); }
  void step(const Eigen::Vector3d& p_map_vehicle, const CorrectionEffort& effort, CorrectionStep& out);
  void beforeRemoval(const VoxelVolume& volume, std::span<const std::uint32_t> slots) override;
  void beforeRenewal(const VoxelVolume& volume, std::uint32_t slot) override;
  void take(const BlockIndex& index, const VoxelBlock& voxels, const LabelBlock* labels) override;
  /// Stores all blocks of the volume, at the end of an epoch.
  void storeAll();
  /// Submaps::addKept().
  bool addKept(const Submap& submap);
  /// Stores a block of a kept map; the block names its submap.
  void store(const StoredBlock& block) { stored_.put(block); }

  /// Passes the blocks of the submaps for which `wanted` holds to `take`, stored ones and the volume's, tile
  /// by tile in a volume. `slots` are the blocks of the tile; their neighbours are in the volume too. Memory
  /// and cost are not bounded: for the end of a run.
  void visitWhole(const std::function<bool(const Submap&)>& wanted,
                  const std::function<void(const VoxelVolume&, std::span<const std::uint32_t> slots)>& take);
  /// The same in one volume, with as much memory as needed.
  VoxelVolume wholeVolume(const std::function<bool(const Submap&)>& wanted);

  [[nodiscard]] const VoxelVolume& volume() const { return volume_; }
  [[nodiscard]] const Submaps& submaps() const { return submaps_; }
  [[nodiscard]] const StoredBlocks& stored() const { return stored_; }
  [[nodiscard]] const SubmapCounters& counters() const { return counters_; }
  [[nodiscard]] std::size_t bytes() const;

 private:
  void layHintsAnew();
  [[nodiscard]] bool agree(SubmapId a, SubmapId b, const BlockIndex& block) const;
  [[nodiscard]] Eigen::Vector3d placeOf(const BlockIndex& block, SubmapId id) const;

  VoxelVolume& volume_;
  Submaps submaps_;
  StoredBlocks stored_;
  BlockBlend hints_;
  Eigen::Vector3d half_box_;
  std::vector<SE3> shown_;  ///< T_map_world of each submap when its blocks last returned
  std::size_t cursor_ = 0;  ///< next record to look at
  Eigen::Vector3d p_map_pass_ = Eigen::Vector3d::Zero();  ///< of the vehicle when the pass began
  std::vector<std::uint32_t> leaving_;                    ///< scratch: slots
  StoredBlock scratch_;
  SubmapCounters counters_;
};

}  // namespace swiftlet
