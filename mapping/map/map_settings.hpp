#pragma once
// Settings of the map, given at construction.

#include <cstddef>
#include <cstdint>
#include <string>

namespace swiftlet {

struct MapSettings {
  double voxel_size = 0.05;      ///< m; the truncation distance is three voxels
  int volume_mib = 64;           ///< memory for voxels, some 100 m^2 of labelled surface
  int surface_mib = 32;          ///< memory for triangles shown in flight, including dropped blocks
  double most_range = 10;        ///< m; farther measurements only make space free up to here
  bool labels = true;            ///< keep labels if a log or a network gives them
  double label_certainty = 0.9;  ///< probability that a pixel's label is right
  /// Labels of moving things, which are not mapped: numbers separated by commas.
  std::string moving_labels = "";
};

}  // namespace swiftlet
