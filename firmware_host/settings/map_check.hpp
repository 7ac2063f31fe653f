#pragma once
// Checks settings of the map that a range for each cannot, and the cameras that it takes depth from; every
// command with a map calls it first.

#include <fmt/format.h>

#include <string>

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

/// What the user must know of the depth of this pair; empty: nothing. Without a depth sensor only.
inline std::string nearDepthWarning(const Rig& rig) {
  const DepthStage stage(rig);
  if (!stage.status().ok() || stage.nearestDepth() <= DepthSettings{}.wanted_nearest) return {};
  return fmt::format(
      "the cameras measure depth from {:.1f} m on: nearer obstacles are missing from the map or lie too far "
      "away. Use smaller images, a wider lens, a shorter baseline or a depth sensor",
      stage.nearestDepth());
}

}  // namespace swiftlet
