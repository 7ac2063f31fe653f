#pragma once
// A surface in the page's 3D view, small enough for one page.
//
// One of more than kMostVertices corners or kMostFaces triangles is thinned: corners are drawn together on a
// grid, as coarse as need be, triangles that fall together go. Corners are then whole numbers of 16 bits
// between the surface's lowest and highest corner, errors of 8 bits up to `most`.

#include <functional>
#include <nlohmann/json.hpp>
#include <span>

#include "firmware_host/outputs/map_files/triangle_mesh.hpp"

namespace swiftlet {

inline constexpr std::size_t kMostVertices = 65535;
inline constexpr std::size_t kMostFaces = 120'000;

/// The surface reduced to at most this many vertices and triangles; unchanged if it has no more. `cell`
/// receives the width of the grid [m], 0 if the surface was not reduced. O(triangles log triangles).
TriangleMesh thinned(const TriangleMesh& mesh, std::size_t vertices, std::size_t faces, double& cell);

/// Adds "low", "size" and "points": each coordinate of at least one point in 16 bits between the lowest and
/// the highest.
void addPoints(nlohmann::ordered_json& json, std::span<const Eigen::Vector3f> points);

/// How far a corner lies off the truth [m]; `most` where it is farther.
using SurfaceError = std::function<double(const Eigen::Vector3f& corner, double most)>;

/// {"id", "name", "vertices", "faces", "low", "size", "points", "grey", "triangles", "labels", "error",
/// "error_most", "note"}, thinned where it has to be; `mesh` has a corner. Empty `error`: none is known.
nlohmann::ordered_json surfaceJson(const char* id, const char* name, const TriangleMesh& mesh,
                                   const SurfaceError& error = {});

}  // namespace swiftlet
