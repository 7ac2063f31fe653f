#pragma once
// Figures of meshes as JSON and as a table for the terminal.

#include <nlohmann/json.hpp>
#include <string>

#include "firmware_host/lab/evaluation/mesh_accuracy.hpp"

namespace swiftlet {

nlohmann::ordered_json toJson(const MeshAccuracy& accuracy);
std::string toText(const MeshAccuracy& accuracy);

}  // namespace swiftlet
