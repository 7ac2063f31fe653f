#pragma once
// The map's surface as files at the end of a run: map.ply and map.glb, and map_epoch_N.ply for each earlier
// epoch whose world nothing ties to the newest.

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "mapping/map/map_stage.hpp"

namespace swiftlet {

/// `tied`: earlier epochs that lie in the newest one's map. Gives what summary.json says of the map.
/// InputError if a file cannot be written.
nlohmann::ordered_json writeMap(const std::string& folder, MapStage& map,
                                std::span<const std::uint32_t> tied);

/// After all that is written of a map: what failed reads of its stored blocks cost; empty: none failed.
std::string unreadProblem(const std::string& folder, const MapSubmaps& submaps);

}  // namespace swiftlet
