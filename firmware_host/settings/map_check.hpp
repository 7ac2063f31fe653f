#pragma once
// Checks settings of the map that a range for each cannot; every command with a map calls it first.

#include <fmt/format.h>

#include "drivers/input/input_error.hpp"
#include "mapping/map/map_stage.hpp"

namespace swiftlet {

/// InputError if the moving labels are no list, or if the voxels are too small for the range.
inline void checkMapSettings(const MapSettings& settings) {
  if (!labelMask(settings.moving_labels)) {
    throw InputError("map.moving_labels", 0, "", "\"" + settings.moving_labels + "\" is not a list of labels",
                     "Write numbers from 1 to 31 separated by commas, for example 10,12");
  }
  // Each image marks the blocks of a cube as wide as twice the range: 16 MiB with so many voxels each way.
  constexpr double kMostVoxels = 2000;
  if (settings.most_range / settings.voxel_size <= kMostVoxels) return;
  throw InputError("map.most_range", 0, "",
                   fmt::format("{:g} m are more than {:g} voxels of {:g} m", settings.most_range, kMostVoxels,
                               settings.voxel_size),
                   fmt::format("Use at most {:g} m, or larger voxels (map.voxel_size)",
                               kMostVoxels * settings.voxel_size));
}

}  // namespace swiftlet
