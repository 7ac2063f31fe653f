#pragma once
// Updates one block from one depth image: every voxel is projected into the image, and the depth measured
// there updates its distance (Curless, Levoy, "A Volumetric Method for Building Complex Models from Range
// Images", SIGGRAPH 1996).
//
// Let d be the depth of the pixel that a voxel's centre falls on and z the centre's own depth. The voxel's
// distance s is d - z times the pixel's slope, its distance to the plane that the pixel shows
// (prepared_image.hpp). Voxels with -behind <= s are observed; s is cut at the truncation distance, so that
// free voxels are carved. The weight falls from one voxel behind the surface to zero at `behind` (Bylow et
// al., RSS 2013; Oleynikova et al., IROS 2017). A voxel is not free if the nearest pixel of its tile is
// within a voxel of its depth: it may hold an object thinner than itself. Weights grow up to most_weight. If
// a certain measurement shows surface in free space, all earlier views count as one: an object that appears
// is mapped within some images, however long the space was free. Eight voxels at a time (lanes.hpp). Cost:
// docs/experiments/map.md.

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "estimator/geometry/se3.hpp"
#include "mapping/volume/lanes.hpp"
#include "mapping/volume/prepared_image.hpp"
#include "mapping/volume/voxel_block.hpp"
#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

/// The sides of a surface on which a block has observed voxels (BlockHeader::sides).
std::uint8_t sidesOf(const VoxelBlock& block);

/// Holds the data that all blocks of an image share.
class BlockUpdate {
 public:
  explicit BlockUpdate(const VolumeSettings& settings);

  /// Call before the blocks of an image. The image must outlive their updates.
  void begin(const PreparedImage& image, const SE3& T_camera_world);

  struct Result {
    std::uint32_t observed = 0;  ///< voxels
    float largest_change = 0;    ///< of a distance [steps]
    std::uint8_t sides = 0;      ///< BlockHeader::sides after the update
    bool news = false;           ///< a first observation, or a side or most frequent label changed
  };

  /// Updates by projection. `labels` may be null.
  Result project(const BlockIndex& index, VoxelBlock& block, LabelBlock* labels) const;
  /// Updates a block that was seen free as a whole.
  Result carve(VoxelBlock& block) const;

 private:
  /// Shared by the groups of eight voxels of a block.
  struct Sums;
  void projectEight(const Eigen::Vector3f& first, std::size_t at, VoxelBlock& block, LabelBlock* labels,
                    Sums& sums) const;
  void colour(const lanes::Ints& pixel, const lanes::Ints& near, const lanes::Floats& gain,
              const lanes::Floats& sum, std::size_t at, VoxelBlock& block, LabelBlock* labels,
              Sums& sums) const;

  VolumeSettings settings_;
  float sure_;  ///< square of kSureSigmas sigmas, times the weight of a pixel with that sigma
  const PreparedImage* image_ = nullptr;
  SE3 T_camera_world_;
  /// Vectors from a block's first voxel to each of its voxels, in camera axes.
  alignas(64) std::array<float, kBlockVoxels> x_{}, y_{}, z_{};
};

}  // namespace swiftlet
