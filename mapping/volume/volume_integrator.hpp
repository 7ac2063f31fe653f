#pragma once
// The stage that fuses depth images into a volume.
//
// 1. Band: lists the blocks within a voxel of a measured surface point and makes room for the new ones.
// 2. Bundles: all rays of a tile of 16 x 16 pixels walk as one through the blocks up to their deepest pixel
//    (Amanatides, Woo, 1987), skipping blocks that the image has already met. This is the "fast" bundled ray
//    casting of Voxblox (Oleynikova et al., IROS 2017) on blocks instead of voxels. A block in front of
//    everything measured is free as a whole; of the others, those with voxels are updated.
// 3. Update: block_update.hpp, voxel by voxel.
//
// A block near a surface for which the volume has no room is fused separately, from this image only, and
// passed to BlockOverflow.
//
// `effort` bounds the number of updated blocks; those of the band go first, nearest first. Memory fixed at
// construction, no clock, no randomness: the same images give the same bytes.
// kInvalidInput, counted, for refused images: wrong size or intrinsics, a pose or extrinsic that is not
// finite, a stamp not after the last, a pose jump (VolumeSettings::most_speed, most_turn_rate). The next
// image is compared with the refused one, so one jump costs one image. kCapacityReached if blocks were
// refused or left out; the rest was fused.

#include <cstdint>
#include <optional>
#include <vector>

#include "estimator/core/status.hpp"
#include "estimator/messages/depth_image.hpp"
#include "mapping/volume/block_update.hpp"
#include "mapping/volume/block_window.hpp"
#include "mapping/volume/prepared_image.hpp"
#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

/// Takes blocks, fused from one image, for which the volume has no room.
class BlockOverflow {
 public:
  virtual ~BlockOverflow() = default;
  virtual void take(const BlockIndex& index, const VoxelBlock& voxels, const LabelBlock* labels) = 0;
};

struct VolumeEffort {
  std::uint32_t blocks = 1U << 20U;  ///< largest number updated or carved per image

  bool operator==(const VolumeEffort&) const = default;
};

/// Result of one image.
struct VolumeStep {
  std::uint32_t band = 0;      ///< blocks near measured surface
  std::uint32_t updated = 0;   ///< blocks updated by projection, in the band and elsewhere
  std::uint32_t carved = 0;    ///< blocks with voxels that are free as a whole
  std::uint32_t changed = 0;   ///< blocks that readers must read again
  std::uint32_t left_out = 0;  ///< for lack of effort; blocks behind the first of them are not counted
  std::uint32_t no_room = 0;   ///< new blocks refused
  std::uint32_t apart = 0;     ///< new blocks without room, passed to BlockOverflow
};

struct IntegratorCounters {
  std::uint64_t images = 0;   ///< fused images
  std::uint64_t refused = 0;  ///< images refused for any reason, the next three among them
  std::uint64_t pose_jumps = 0;
  std::uint64_t bad_poses = 0;
  std::uint64_t bad_stamps = 0;
  std::uint64_t blocks_left_out = 0;
  PixelCounters pixels;
};

class VolumeIntegrator {
 public:
  /// `volume` must outlive this object. `most_pixels`: largest image to come.
  VolumeIntegrator(VoxelVolume& volume, std::size_t most_pixels);
  /// `overflow` must outlive this object. Null: new blocks without room are refused.
  void setOverflow(BlockOverflow* overflow) { overflow_ = overflow; }

  /// Calls accept() and fuse().
  [[nodiscard]] Status step(const DepthImageView& image, const SE3& T_world_body, const VolumeEffort& effort,
                            VolumeStep& out);
  /// Compares pose and stamp with those of the image before. kInvalidInput: the image must not be fused.
  [[nodiscard]] Status accept(const DepthImageView& image, const SE3& T_world_body);
  /// Fuses an image that was accepted.
  [[nodiscard]] Status fuse(const DepthImageView& image, const SE3& T_world_body, const VolumeEffort& effort,
                            VolumeStep& out);
  /// Forgets the last pose and stamp, for a new epoch or a map that was moved.
  void restart() { last_.reset(); }

  [[nodiscard]] const IntegratorCounters& counters() const { return counters_; }
  /// Memory, without that of the volume.
  [[nodiscard]] std::size_t bytes() const;

 private:
  struct Pose {
    Stamp stamp;
    SE3 T_world_body;
  };

  Status checkPose(const DepthImageView& image, const SE3& T_world_body);
  void begin(const SE3& T_world_camera);
  void listBand(std::uint32_t blocks, VolumeStep& out);
  void addBandPoint(const Eigen::Vector3f& p);
  void walkBundles(std::uint32_t blocks, VolumeStep& out);
  bool walk(const Eigen::Vector3f& direction, float length, std::uint32_t blocks, VolumeStep& out);
  void meetOnRay(const BlockIndex& block, VolumeStep& out);
  /// Depth [m] between a cube, `share` times as large as a block, and the nearest measurement behind it;
  /// negative if unknown. `centre`: in camera axes.
  [[nodiscard]] float freeBehind(const Eigen::Vector3f& centre, float share) const;
  /// Parts of the block with this centre that the image sees free; parts in `known` are not tested.
  [[nodiscard]] std::uint64_t freeParts(const Eigen::Vector3f& centre, std::uint64_t known) const;
  void update(std::uint32_t slot, bool carve, VolumeStep& out);
  void fuseApart(const BlockIndex& block, VolumeStep& out);

  VoxelVolume& volume_;
  PreparedImage image_;
  BlockUpdate update_;
  BlockWindow window_;
  std::size_t most_band_;
  std::vector<BlockIndex> band_;
  std::size_t with_room_ = 0;  ///< the first `with_room_` blocks of the band have room
  BlockOverflow* overflow_ = nullptr;
  VoxelBlock apart_;  ///< scratch
  LabelBlock labels_apart_;
  std::optional<Pose> last_;
  IntegratorCounters counters_;

  // Of the present image. Rays and points are in blocks, relative to the camera's block.
  SE3 T_world_camera_;
  SE3 T_camera_world_;
  Eigen::Vector3f vehicle_ = Eigen::Vector3f::Zero();
  BlockIndex centre_;
  Eigen::Vector3f origin_ = Eigen::Vector3f::Zero();
  Eigen::Matrix3f R_blocks_camera_ = Eigen::Matrix3f::Identity();
  Eigen::Vector3f half_extent_ = Eigen::Vector3f::Zero();  ///< of a block in camera axes [m]
  std::array<Eigen::Vector3f, 8> octant_centre_;           ///< from the block's, in camera axes [m]
  std::array<std::int32_t, 6> last_band_{};
};

}  // namespace swiftlet
