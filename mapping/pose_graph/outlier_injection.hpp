#pragma once
// False loop closures for experiments, added to a pose graph: the same seed gives the same loops.
//
// A false loop joins two poses drawn uniformly (never neighbours of the odometry) by a random relative pose:
// the place of the second as seen from the first is uniform in the box that bounds the graph's poses, its
// rotation uniform. Its information is that of a loop of the graph, drawn at random. Such a loop is false but
// by chance: the share of the volume that the loop's own noise covers, below 1e-3 in all benchmark graphs.
//
// Groups imitate two places that look alike: `group_size` loops in a row of poses that all claim the same
// false transform, chained with the graph's own odometry and with noise of their information. They agree with
// each other as true loops do. With group_size 1 every loop is on its own.
//
// Shapes: poses of at least 3; a loop is an edge that does not join pose k to pose k + 1. Cost: linear.

#include <cstdint>

#include "estimator/core/status.hpp"
#include "mapping/pose_graph/pose_graph.hpp"

namespace swiftlet {

struct OutlierInjection {
  std::uint32_t count = 0;       ///< false loops to add, also when it is not a multiple of the group's size
  std::uint64_t seed = 1;        ///< of swiftlet::Random
  std::uint32_t group_size = 1;  ///< mutually consistent loops in a row, 1: each on its own
};

/// An edge of the graph that is part of the odometry chain.
template <typename Pose>
bool isOdometry(const RelativePose<Pose>& edge) {
  return edge.to == edge.from + 1;
}

/// How many false loops make up `share` (in [0, 1)) of all loops beside `true_loops`, rounded.
std::uint32_t outlierCount(std::uint32_t true_loops, double share);

/// Appends the false loops after the edges there are. kInvalidInput, with nothing added, when the graph has
/// fewer than 3 poses or no edge, or a group does not fit its poses. Graphs without a given start need one
/// first: `graph.poses` bounds the scene.
template <typename Pose>
Status injectOutliers(const OutlierInjection& injection, PoseGraph<Pose>& graph);

}  // namespace swiftlet
