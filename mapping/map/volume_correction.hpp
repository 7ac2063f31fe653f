#pragma once
// Puts the volume right when images that it holds turn out to have been seen from elsewhere: loop closure
// has moved the map, or the smoother its window.
//
// Begin: kept images whose surface moved by more than half a voxel are out of place. Every block that one of
// them saw from its old pose is dropped, from volume and surface. Step by step, nearest to the vehicle first,
// they are fused again from where they belong; so are, into the dropped blocks alone, those others that see
// one. So nothing is fused twice into a block. What no kept image saw stays as it was; what was dropped comes
// back as far as kept images saw it.
//
// Frames: world (the odometry's), map, body; metres. Memory: KeptDepths and 12 bytes a block, reserved at
// construction. Cost: beginning, blocks times kept images (some 0.1 s for 10 000 and 300); a step, that of
// its images (VolumeIntegrator). No clock; deterministic. Source of the idea: re-integration of Dai et al.
// (BundleFusion, 2017), here block by block without subtracting, which needs no exact inverse of carving and
// capped weights.

#include <cstdint>
#include <span>
#include <vector>

#include "mapping/map/kept_depths.hpp"
#include "mapping/surface/surface_store.hpp"
#include "mapping/volume/volume_integrator.hpp"

namespace swiftlet {

/// A frame as the odometry has it by now.
struct RefinedPose {
  std::uint64_t frame = 0;
  SE3 T_world_body;
};

/// How the odometry's world of a keyframe lies in the map.
struct WorldInMap {
  std::uint64_t frame = 0;
  SE3 T_map_world;
};

struct CorrectionEffort {
  /// Fusing an image again begins while fewer blocks were updated: of some five keyframes.
  std::uint32_t blocks = 4000;

  bool operator==(const CorrectionEffort&) const = default;
};

struct CorrectionStep {
  std::uint32_t images = 0;   ///< fused again
  std::uint32_t waiting = 0;  ///< images that are still to be
};

struct CorrectionCounters {
  std::uint64_t corrections = 0;  ///< that moved the surface
  std::uint64_t images_moved = 0;
  std::uint64_t blocks_dropped = 0;  ///< to be made up anew
};

class VolumeCorrection {
 public:
  /// All outlive it.
  VolumeCorrection(VoxelVolume& volume, VolumeIntegrator& integrator, SurfaceStore& store, std::size_t bytes,
                   std::size_t most_pixels);

  /// An image that has just been fused. `about`: frame and poses.
  void keep(const DepthImageView& image, std::uint64_t frame, const SE3& T_map_world,
            const SE3& T_world_body);
  /// Frames that are not kept are passed over.
  void refine(std::span<const RefinedPose> poses);
  /// Ordered by frame; between two the world moves evenly with the frames' numbers.
  void correct(std::span<const WorldInMap> worlds);
  /// True while images wait to be fused again.
  [[nodiscard]] bool busy() const { return waiting_ > 0; }
  /// `vehicle` in the map: what is near comes first.
  void step(const Eigen::Vector3f& vehicle, const CorrectionEffort& effort, CorrectionStep& out);
  /// A new world: nothing of the old one is kept.
  void restart();

  [[nodiscard]] const KeptDepths& kept() const { return kept_; }
  [[nodiscard]] const CorrectionCounters& counters() const { return counters_; }
  [[nodiscard]] std::size_t bytes() const;

 private:
  [[nodiscard]] bool isOutOfPlace(const KeptFrame& frame) const;
  /// Whether a camera whose depths are in `tiles_` measured anything in the block, or through it.
  [[nodiscard]] bool sees(const PinholeIntrinsics& camera, const SE3& T_camera_map,
                          const BlockIndex& block) const;
  void begin();
  void dropSeen();
  void countWaiting();
  [[nodiscard]] std::size_t nearestPending(const Eigen::Vector3f& vehicle) const;

  VoxelVolume& volume_;
  VolumeIntegrator& integrator_;
  SurfaceStore& store_;
  KeptDepths kept_;
  std::uint32_t waiting_ = 0;
  std::vector<std::uint32_t> leaving_;  ///< scratch: slots
  std::vector<BlockIndex> dropped_;     ///< scratch
  DepthTiles tiles_;                    ///< scratch, of one image
  CorrectionCounters counters_;
};

}  // namespace swiftlet
