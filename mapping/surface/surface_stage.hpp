#pragma once
// The stage that keeps the surface up to date: marching cubes over changed blocks, into the store.
//
// A changed block affects the surface of its 26 neighbours too (cubes at the border, normals). `effort`
// bounds the blocks of one step; the others wait. They are drawn in passes: a pass covers all blocks that are
// out of date when it begins, nearest to the vehicle first, over several steps. A block that changes during a
// pass is drawn in it if its turn is still to come, otherwise in the next, so none waits longer than two
// passes. As the volume's listener the stage draws blocks that are out of date before they are dropped, so
// that the store has the newest surface of everything the volume ever held. Neighbours of a dropped block are
// drawn without it, and a seam one voxel wide may open. A block that returns replaces its patch. Memory:
// fixed at construction, 13 bytes a slot and one patch. Cost: docs/experiments/map.md.

#include <cstdint>
#include <span>
#include <vector>

#include "mapping/surface/block_surface.hpp"
#include "mapping/surface/surface_store.hpp"
#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

struct SurfaceEffort {
  std::uint32_t blocks = 300;  ///< drawn per step; 6 to 10 us each

  bool operator==(const SurfaceEffort&) const = default;
};

struct SurfaceStep {
  std::uint32_t drawn = 0;
  std::uint32_t waiting = 0;  ///< blocks still out of date
};

struct SurfaceCounters {
  std::uint64_t drawn = 0;
};

/// Draws the whole surface in one step.
inline constexpr SurfaceEffort kAllSurface{1U << 20U};

class SurfaceStage : public BlockListener {
 public:
  /// All arguments but `settings` must outlive this object. Adds itself to the volume's listeners.
  SurfaceStage(VoxelVolume& volume, const ConfusionModel& confusion, SurfaceStore& store,
               const SurfaceSettings& settings = {});
  SurfaceStage(const SurfaceStage&) = delete;
  SurfaceStage& operator=(const SurfaceStage&) = delete;

  /// `vehicle` in world: when the store is full, it keeps the patches nearest to it. kCapacityReached while
  /// blocks wait.
  Status step(const Eigen::Vector3f& vehicle, const SurfaceEffort& effort, SurfaceStep& out);
  void beforeRemoval(const VoxelVolume& volume, std::span<const std::uint32_t> slots) override;
  /// Nothing to do: the block is drawn again with its next change.
  void beforeRenewal(const VoxelVolume& /*volume*/, std::uint32_t /*slot*/) override {}
  /// Marks every block as out of date, after the volume was cleared or moved.
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
  std::vector<std::uint32_t> seen_;  ///< of each slot: last revision read
  std::vector<std::uint8_t> is_old_;
  std::vector<Waiting> pass_;
  std::size_t next_ = 0;  ///< next entry of pass_
  std::uint32_t old_count_ = 0;
  Eigen::Vector3f vehicle_ = Eigen::Vector3f::Zero();
  SurfacePatch patch_;
  SurfaceCounters counters_;
};

}  // namespace swiftlet
