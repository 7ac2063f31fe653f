#pragma once
// First poses of a graph from its relative poses alone: along the odometry (edges between neighbouring poses
// k and k + 1), and over other edges only where it does not lead. The first pose of each piece is the origin.
// Cost: linear in the graph.

#include "mapping/pose_graph/pose_graph.hpp"

namespace swiftlet {

/// Overwrites `poses` (count as it is).
template <typename Pose>
void odometryStart(PoseGraph<Pose>& graph);

}  // namespace swiftlet
