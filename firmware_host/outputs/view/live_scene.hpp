#pragma once
// Surfaces of the live view as parts of the report's scene.

#include <nlohmann/json.hpp>
#include <span>

#include "estimator/geometry/se3.hpp"
#include "mapping/surface/surface_patch.hpp"

namespace swiftlet {

/// {"id", "name", "count", "low", "size", "points", "grey", "labels", "note"}: 16-bit x y z between `low` and
/// `low` + `size`, grey and label of each point in 8 bits. More than `most` points are thinned evenly.
/// `vertices` must not be empty. `T_to_from`: to the axes of the scene.
nlohmann::ordered_json cloudJson(const char* id, const char* name, std::span<const SurfaceVertex> vertices,
                                 const SE3& T_to_from, std::size_t most);

}  // namespace swiftlet
