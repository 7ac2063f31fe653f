#pragma once
// Writes the map's surface at the end of a run: map.ply and map.glb, and map_epoch_N.ply for each earlier
// epoch whose world is not tied to the newest.

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "mapping/map/map_stage.hpp"

namespace swiftlet {

/// `tied`: earlier epochs that lie in the newest epoch's map. Returns the map's part of summary.json.
/// InputError if a file cannot be written.
nlohmann::ordered_json writeMap(const std::string& folder, MapStage& map,
                                std::span<const std::uint32_t> tied);

/// Call after everything of the map has been written: describes failed reads of its stored blocks; empty:
/// none failed.
std::string unreadProblem(const std::string& folder, const MapSubmaps& submaps);

}  // namespace swiftlet
