#pragma once
// The report's 3D view as data: trajectories and surfaces in the run's world.

#include <nlohmann/json.hpp>

#include "firmware_host/lab/evaluation/mesh_distance.hpp"
#include "firmware_host/lab/report/run_view.hpp"

namespace swiftlet {

/// {"trajectories": [{"name", "style", "count", "points", "value", "value_label"}], "surfaces": [results of
/// surfaceJson()]}. `truth`: the true surface in the truth's axes; null: surfaces have no errors.
nlohmann::ordered_json sceneOf(const RunView& view, const MeshDistance* truth);

}  // namespace swiftlet
