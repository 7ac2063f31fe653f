#pragma once
// The report's 3D view as data: trajectories and surfaces in the run's world, small enough for one page.
//
// A surface of more than kMostVertices corners or kMostFaces triangles is thinned: corners are drawn
// together on a grid, as coarse as need be, triangles that fall together go. Corners are then whole numbers
// of 16 bits between the surface's lowest and highest corner, errors of 8 bits up to `most`.

#include <nlohmann/json.hpp>

#include "firmware_host/evaluation/mesh_distance.hpp"
#include "firmware_host/report_page/run_view.hpp"

namespace swiftlet {

inline constexpr std::size_t kMostVertices = 65535;
inline constexpr std::size_t kMostFaces = 120'000;

/// A surface with at most that many corners and triangles; as it was where it has no more. `cell` becomes the
/// grid's width [m], 0 where nothing was thinned. O(triangles log triangles).
TriangleMesh thinned(const TriangleMesh& mesh, std::size_t vertices, std::size_t faces, double& cell);

/// One of the scene's "surfaces" (see below), thinned where it has to be; `mesh` has a corner. `fit`: from
/// the mesh's axes to the truth's.
nlohmann::ordered_json surfaceJson(const char* id, const char* name, const TriangleMesh& mesh,
                                   const Alignment& fit = {}, const MeshDistance* truth = nullptr);

/// {"trajectories": [{"name", "style", "count", "points", "value", "value_label"}], "surfaces": [{"id",
/// "name", "vertices", "faces", "low", "size", "points", "grey", "triangles", "labels", "error",
/// "error_most", "note"}]}. `truth`: the true surface in the truth's axes; null: surfaces have no error.
nlohmann::ordered_json sceneOf(const RunView& view, const MeshDistance* truth);

}  // namespace swiftlet
