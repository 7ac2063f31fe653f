#pragma once
// What the map is told once.

#include <cstddef>
#include <cstdint>
#include <string>

namespace swiftlet {

struct MapSettings {
  double voxel_size = 0.05;      ///< m; the truncation distance is three of them
  int volume_mib = 64;           ///< voxels: some 100 m^2 of labelled surface
  int surface_mib = 32;          ///< triangles to look at in flight, of what the volume dropped too
  double most_range = 10;        ///< m; what is measured farther away is left out
  bool labels = true;            ///< keep labels where a log or a network gives them
  double label_certainty = 0.9;  ///< probability that a pixel's label is right
  /// Labels of things that move, which are not mapped: numbers with commas.
  std::string moving_labels = "";
};

}  // namespace swiftlet
