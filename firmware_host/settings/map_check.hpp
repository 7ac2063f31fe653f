#pragma once
// Checks map settings that a range per setting cannot express, and the cameras that give depth. Every command
// with a map calls it first.

#include <fmt/format.h>

#include <string>

#include "drivers/input/input_error.hpp"
#include "mapping/map/map_stage.hpp"

namespace swiftlet {

/// InputError if moving_labels is not a list of labels, or if the voxels are too small for the range.
inline void checkMapSettings(const MapSettings& settings) {
  if (!labelMask(settings.moving_labels)) {
    throw InputError("map.moving_labels", 0, "", "\"" + settings.moving_labels + "\" is not a list of labels",
                     "Write numbers from 1 to 31 separated by commas, for example 10,12");
  }
  // Each image marks the blocks of a cube whose edge is twice the range: 16 MiB at this many voxels per
  // range.
  constexpr double kMostVoxels = 2000;
  if (settings.most_range / settings.voxel_size <= kMostVoxels) return;
  throw InputError("map.most_range", 0, "",
                   fmt::format("{:g} m are more than {:g} voxels of {:g} m", settings.most_range, kMostVoxels,
                               settings.voxel_size),
                   fmt::format("Use at most {:g} m, or larger voxels (map.voxel_size)",
                               kMostVoxels * settings.voxel_size));
}

/// Warning for a pair that measures no near depth; empty: there is none. For runs without a depth sensor.
inline std::string nearDepthWarning(const Rig& rig) {
  const DepthStage stage(rig);
  if (!stage.status().ok() || stage.nearestDepth() <= DepthSettings{}.wanted_nearest) return {};
  return fmt::format(
      "the cameras measure depth from {:.1f} m on: nearer obstacles are missing from the map or lie too far "
      "away. Use smaller images, a wider lens, a shorter baseline or a depth sensor",
      stage.nearestDepth());
}

}  // namespace swiftlet
