#pragma once
// A surface in the page's 3D view, small enough for one page.
//
// A surface with more than kMostVertices vertices or kMostFaces triangles is thinned: vertices are merged on
// a grid that is as coarse as necessary, and degenerate or equal triangles are removed. Then coordinates are
// 16-bit integers between the surface's lowest and highest corner, and errors 8-bit integers up to `most`.

#include <functional>
#include <nlohmann/json.hpp>
#include <span>

#include "firmware_host/outputs/map_files/triangle_mesh.hpp"

namespace swiftlet {

inline constexpr std::size_t kMostVertices = 65535;
inline constexpr std::size_t kMostFaces = 120'000;

/// The surface reduced to at most this many vertices and triangles; unchanged if it has no more. `cell`
/// receives the grid width [m]; 0 if the surface was not reduced. O(triangles log triangles).
TriangleMesh thinned(const TriangleMesh& mesh, std::size_t vertices, std::size_t faces, double& cell);

/// Adds "low", "size" and "points": coordinates as 16-bit integers between the lowest and the highest.
/// `points` must not be empty.
void addPoints(nlohmann::ordered_json& json, std::span<const Eigen::Vector3f> points);

/// Distance of a vertex from the truth [m]; at most `most`.
using SurfaceError = std::function<double(const Eigen::Vector3f& corner, double most)>;

/// {"id", "name", "vertices", "faces", "low", "size", "points", "grey", "triangles", "labels", "error",
/// "error_most", "note"}, thinned if necessary. `mesh` must have a vertex. Empty `error`: errors are unknown.
nlohmann::ordered_json surfaceJson(const char* id, const char* name, const TriangleMesh& mesh,
                                   const SurfaceError& error = {});

}  // namespace swiftlet
