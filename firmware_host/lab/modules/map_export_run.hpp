#pragma once
// A kept map in the formats of other tools: what `swiftlet map export` calls.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "firmware_host/lab/modules/map_slice.hpp"

namespace swiftlet {

struct MapExportRequest {
  std::string map;          ///< kept map: its folder, or its volume
  std::string out;          ///< new folder
  std::optional<double> z;  ///< m, of the slices; none: the middle of the map's height
};

/// Grey values as ROS's map_server reads them with `mode: trinary`: surface 0, free 254, unknown and behind a
/// surface 205.
std::vector<std::uint8_t> occupancyPixels(const MapSlice& slice);
/// With `mode: raw`: distances in percent of the reach, 100 where no surface is in reach, 0 on and behind
/// surfaces; 255 unknown.
std::vector<std::uint8_t> distancePixels(const MapSlice& slice);

/// Writes surface.ply, surface.glb, voxels.ply, occupancy.png and distance.png with a .yaml each; gives the
/// figures. InputError for bad input, with file, option and remedy; there is no folder then.
nlohmann::ordered_json runMapExport(const MapExportRequest& request);

}  // namespace swiftlet
