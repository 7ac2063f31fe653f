#pragma once
// The distance field of a whole map at one height, one pixel per voxel: drawn by `swiftlet map slice`.
//
// Distances are those of DistanceField in flight, with its default reach. Its window is placed side by side
// over the map; only the middle of each window is used, where no distance depends on the window's edge. So
// the slice equals that of one window around the whole map. Frames: map, metres. x grows to the right, y
// grows upwards: the first row has the largest y. The height is that of the centres of a layer of voxels.
// Memory: one window (75 MB), 17 bytes per slot of the volume, 5 bytes per pixel. Cost: about 0.2 s per 128 x
// 128 pixels that contain anything.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mapping/volume/voxel_volume.hpp"

namespace swiftlet {

enum class SliceKind : std::uint8_t {
  kUnknown,        ///< nothing was seen there
  kSurface,        ///< a surface passes through the voxel
  kBehindSurface,  ///< the distance is negative
  kAtLeast,        ///< free, and no known surface in reach
  kDistance,       ///< free, and the distance is known
};
inline constexpr std::size_t kSliceKinds = 5;

/// Side length in pixels of the largest slice: 410 m with voxels of 5 cm.
inline constexpr int kMostSliceSide = 8192;

struct MapSlice {
  double voxel_size = 0;  ///< m, size of a pixel
  double z = 0;           ///< m
  double reach = 0;       ///< m; no distance is longer
  /// m, corners of the picture.
  Eigen::Vector2d least = Eigen::Vector2d::Zero(), most = Eigen::Vector2d::Zero();
  int width = 0, height = 0;
  std::vector<SliceKind> kind;  ///< row by row
  /// m, negative behind a surface; NaN if the result is not a distance.
  std::vector<float> distance;

  [[nodiscard]] std::array<std::size_t, kSliceKinds> counts() const;
  /// m, of the pixels with kDistance; 0 if there are none.
  [[nodiscard]] double largestDistance() const;
};

/// The slice at the layer of voxels that contains `z` [m], by default in the middle of the map's height.
/// `name`: the map's file in messages. InputError: no surface in the map, `z` outside of it, nothing known at
/// this height, more than kMostSliceSide voxels along x or y.
MapSlice sliceOf(const std::string& name, const VoxelVolume& volume, std::optional<double> z);

}  // namespace swiftlet
