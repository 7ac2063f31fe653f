#pragma once
// The stage that keeps the surface up to date: marching cubes over changed blocks, into the store.
//
// A changed block touches the surface of its 26 neighbours too (cubes at the border, normals). `effort`
// bounds the blocks of one step; the others wait. They are drawn in passes: all that are out of date when a
// pass begins, nearest to the vehicle first, over as many steps as it takes; what changes meanwhile is drawn
// with the pass where its turn comes still, else in the next. So none waits longer than two passes. As the
// volume's listener it draws what is out of date before blocks are dropped, so that the store has the newest
// surface of everything the volume ever held. Once a block is gone, a neighbour that changes later is drawn
// without it: between the two a seam one voxel wide may open. A block that comes back replaces its patch.
// Memory: fixed at construction, 13 bytes a slot and one patch. Cost: docs/volume.md.

#include <cstdint>
#include <span>
#include <vector>

#include "mapping/surface/block_surface.hpp"
#include "mapping/surface/surface_store.hpp"
#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

struct SurfaceEffort {
  std::uint32_t blocks = 300;  ///< drawn in one step; 6 to 10 us each

  bool operator==(const SurfaceEffort&) const = default;
};

struct SurfaceStep {
  std::uint32_t drawn = 0;
  std::uint32_t waiting = 0;  ///< out of date still
};

struct SurfaceCounters {
  std::uint64_t drawn = 0;
  std::uint64_t drawn_before_removal = 0;
};

/// For who wants the whole surface now.
inline constexpr SurfaceEffort kAllSurface{1U << 20U};

class SurfaceStage : public BlockListener {
 public:
  /// Both, and `confusion`, outlive it. Adds itself to the volume's listeners.
  SurfaceStage(VoxelVolume& volume, const ConfusionModel& confusion, SurfaceStore& store,
               const SurfaceSettings& settings = {});
  SurfaceStage(const SurfaceStage&) = delete;
  SurfaceStage& operator=(const SurfaceStage&) = delete;

  /// `vehicle` in world: what the store keeps when it is full. kCapacityReached while blocks wait.
  Status step(const Eigen::Vector3f& vehicle, const SurfaceEffort& effort, SurfaceStep& out);
  void beforeRemoval(const VoxelVolume& volume, std::span<const std::uint32_t> slots) override;
  /// What there is of the block is drawn anew with the changes to come.
  void beforeRenewal(const VoxelVolume& /*volume*/, std::uint32_t /*slot*/) override {}
  /// Every block is out of date: after the volume was cleared or moved.
  void drawAll();

  [[nodiscard]] const SurfaceCounters& counters() const { return counters_; }
  [[nodiscard]] std::size_t bytes() const;

 private:
  struct Waiting {
    float squared = 0;  ///< from the vehicle when the pass began
    std::uint32_t slot = 0;
    auto operator<=>(const Waiting&) const = default;
  };

  void findChanges();
  void beginPass();
  void draw(std::uint32_t slot);

  const VoxelVolume& volume_;
  SurfaceStore& store_;
  BlockSurface surface_;
  std::vector<std::uint32_t> seen_;  ///< of each slot, the revision that was looked at
  std::vector<std::uint8_t> is_old_;
  std::vector<Waiting> pass_;
  std::size_t next_ = 0;  ///< of the pass
  std::uint32_t old_count_ = 0;
  Eigen::Vector3f vehicle_ = Eigen::Vector3f::Zero();
  SurfacePatch patch_;
  SurfaceCounters counters_;
};

}  // namespace swiftlet
