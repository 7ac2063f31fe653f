#pragma once
// What became of depth images and blocks in a map, as JSON for summary.json.

#include <nlohmann/json.hpp>

#include "mapping/map/map_stage.hpp"

namespace swiftlet {

nlohmann::ordered_json toJson(const MapStage& map);

}  // namespace swiftlet
