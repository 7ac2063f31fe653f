#pragma once
// Keeps the volume true to the submaps: what loops move leaves it, what lies near the vehicle comes back.
//
// A block goes to the storage when the volume drops it, when its submap moves by more than half a voxel at
// the block, or when an image sees it again after a time or after a correction (VoxelVolume::touch): so no
// block ever mixes images that do not agree. What is stored stays with its submap. Step by step, blocks that
// lie in the box around the vehicle, and in its frame, come back as hints: for the distance field and a depth
// sensor's surface, until an image says better. visitWhole() lays everything over each other where it belongs
// by now: the map as if it had been fused from the corrected poses, but for what moved within a submap.
//
// Frames: map, metres. Memory: Submaps, StoredBlocks and 4 bytes a block of the volume, reserved at
// construction; visitWhole() takes a volume of kTileSide^3 blocks more. Cost: correct(), a pass over the
// volume's blocks and the storing of those that leave (5 us each); a step, that of its blocks. No clock;
// deterministic. Source of the idea: voxgraph (Reijgwart et al., RA-L 2020), whose submaps are volumes of
// their own.

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
  std::uint32_t blocks = 200;  ///< that come back in one step

  bool operator==(const CorrectionEffort&) const = default;
};

struct CorrectionStep {
  std::uint32_t blocks = 0;  ///< that came back
  bool done = true;          ///< all that is near is back
};

struct SubmapCounters {
  std::uint64_t corrections = 0;   ///< that moved a submap out of its place
  std::uint64_t blocks_moved = 0;  ///< that left the volume for it
  std::uint64_t blocks_back = 0;   ///< that came back as hints
  std::uint64_t blocks_apart = 0;  ///< of images, for which the volume had no room
};

class MapSubmaps : public BlockListener, public BlockOverflow {
 public:
  /// Along an edge, what visitWhole() looks at at once.
  static constexpr int kTileSide = 16;

  /// Both outlive it; `storage` may be null (StoredBlocks). Adds itself to the volume's listeners. `half_box`
  /// [m]: of the box around the vehicle into which blocks come back.
  MapSubmaps(VoxelVolume& volume, BlockStorage* storage, MapPoses poses, const Eigen::Vector3d& half_box);
  MapSubmaps(const MapSubmaps&) = delete;
  MapSubmaps& operator=(const MapSubmaps&) = delete;

  /// An image is to be fused; `image` as the anchor of a submap that may begin with it.
  void follow(const Submap& image);
  /// Submaps::correct(), and the volume with it.
  void correct(std::span<const WorldInMap> worlds);
  [[nodiscard]] bool busy() const { return cursor_ < stored_.size(); }
  void step(const Eigen::Vector3d& p_map_vehicle, const CorrectionEffort& effort, CorrectionStep& out);
  void beforeRemoval(const VoxelVolume& volume, std::span<const std::uint32_t> slots) override;
  void beforeRenewal(const VoxelVolume& volume, std::uint32_t slot) override;
  void take(const BlockIndex& index, const VoxelBlock& voxels, const LabelBlock* labels) override;
  /// All of the volume's blocks are stored too: an epoch is over.
  void storeAll();
  /// Submaps::addKept().
  bool addKept(const Submap& submap);
  /// A block of a kept map, of the submap that it names.
  void store(const StoredBlock& block) { stored_.put(block); }

  /// Gives the blocks of the submaps for which `wanted` holds, stored ones and the volume's, as a volume
  /// holds them, tile by tile: slots of blocks whose neighbours are there too. Memory and cost without a
  /// bound on the flight's: for the end of a run.
  void visitWhole(const std::function<bool(const Submap&)>& wanted,
                  const std::function<void(const VoxelVolume&, std::span<const std::uint32_t> slots)>& take);
  /// The same, all in one volume and as much memory as it takes.
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
  std::vector<SE3> shown_;  ///< T_map_world of each submap when its blocks came back last
  std::size_t cursor_ = 0;  ///< record to be looked at
  Eigen::Vector3d p_map_pass_ = Eigen::Vector3d::Zero();  ///< of the vehicle when the pass began
  std::vector<std::uint32_t> leaving_;                    ///< scratch: slots
  StoredBlock scratch_;
  SubmapCounters counters_;
};

}  // namespace swiftlet
