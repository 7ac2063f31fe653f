#pragma once
// A mesh folded where two planes meet: a triangle with corners on both cuts the edge between a floor and a
// wall, by up to half of its own edges. Its two long edges are led over the line in which the planes meet,
// and it becomes three triangles that lie in them.
//
// New vertices lie on that line, where the edge would cross it with the planes folded flat; they are no
// landmarks: their ids count down from kFoldIds. Neighbours share them. After drawOntoPlanes().
// Nothing is allocated (40 kB on the stack). Cost: a search in the report for each face's corners, and among
// the folds made for each new vertex; at most kMaxFolds of them, and what room the mesh has.

#include <cstddef>
#include <limits>

#include "estimator/messages/local_mesh.hpp"
#include "estimator/messages/plane_report.hpp"
#include "estimator/messages/smoothed_window.hpp"

namespace swiftlet {

inline constexpr TrackId kFoldIds = std::numeric_limits<TrackId>::max();
inline constexpr std::size_t kMaxFolds = 256;

/// Returns how many faces were folded. A face stays as it is where its corners are on three planes, or not
/// all on planes, where the planes are nearly parallel or meet elsewhere, or when there is no room.
int foldAtPlanes(const PlaneReport& report, const SmoothedWindow& window, LocalMesh& mesh);

}  // namespace swiftlet
