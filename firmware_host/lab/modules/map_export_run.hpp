#pragma once
// Writes a kept map in the formats of other tools: called by `swiftlet map export`.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "firmware_host/lab/modules/map_slice.hpp"

namespace swiftlet {

struct MapExportRequest {
  std::string map;          ///< kept map: its folder or its volume
  std::string out;          ///< new folder
  std::optional<double> z;  ///< m, height of the slices; empty: the middle of the map's height
};

/// Grey values as read by ROS's map_server with `mode: trinary`: surface 0, free 254, unknown and behind a
/// surface 205.
std::vector<std::uint8_t> occupancyPixels(const MapSlice& slice);
/// For `mode: raw`: distances in percent of the reach, 100 if no surface is in reach, 0 on and behind
/// surfaces; 255 unknown.
std::vector<std::uint8_t> distancePixels(const MapSlice& slice);

/// Writes surface.ply, surface.glb, voxels.ply, occupancy.png and distance.png with a .yaml each, and returns
/// the figures. InputError for bad input, with file, option and remedy; no folder is left then.
nlohmann::ordered_json runMapExport(const MapExportRequest& request);

}  // namespace swiftlet
