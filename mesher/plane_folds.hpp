#pragma once
// Folds a mesh where two planes meet. A triangle with corners on both planes cuts off the edge between, for
// example, a floor and a wall, by up to half of its own edges. Its two edges that cross the intersection line
// of the planes are bent at that line, and the triangle becomes three triangles within the planes.
//
// New vertices lie on the intersection line, where the edge would cross it if the planes were unfolded.
// Neighbours share them. They are not landmarks: their ids count down from kFoldIds. Call it after
// drawOntoPlanes(). No allocation (40 kB on the stack). Cost: a search in the report for each face's corners,
// and among the existing folds for each new vertex. At most kMaxFolds, and as the mesh has room.

#include <cstddef>
#include <limits>

#include "estimator/messages/local_mesh.hpp"
#include "estimator/messages/plane_report.hpp"
#include "estimator/messages/smoothed_window.hpp"

namespace swiftlet {

inline constexpr TrackId kFoldIds = std::numeric_limits<TrackId>::max();
inline constexpr std::size_t kMaxFolds = 256;

/// Returns the number of folded faces. A face is not changed if its corners are on three planes or not all on
/// planes, if the planes are nearly parallel or meet elsewhere, or if there is no room.
int foldAtPlanes(const PlaneReport& report, const SmoothedWindow& window, LocalMesh& mesh);

}  // namespace swiftlet
