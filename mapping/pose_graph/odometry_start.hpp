#pragma once
// Initial poses of a graph from its relative poses: along the odometry (edges between neighbouring poses k
// and k + 1), over other edges only where the odometry does not lead. The first pose of each piece is the
// origin.
// Cost: linear in the graph.

#include "mapping/pose_graph/pose_graph.hpp"

namespace swiftlet {

/// Overwrites `poses`; their number stays.
template <typename Pose>
void odometryStart(PoseGraph<Pose>& graph);

}  // namespace swiftlet
