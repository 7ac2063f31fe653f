#pragma once
// Adds false loop closures to a pose graph, for experiments. The same seed gives the same loops.
//
// A false loop joins two poses drawn uniformly (never neighbours of the odometry) by a random relative pose:
// the position of the second in the frame of the first is uniform in the box that bounds the graph's poses,
// its rotation uniform. Its information is that of a random loop of the graph. The chance that such a loop is
// true is the share of the volume that its noise covers, below 1e-3 in all benchmark graphs.
//
// Groups imitate two places that look alike: `group_size` loops of consecutive poses claim the same false
// transform, chained with the graph's own odometry and with noise of their information. They agree with each
// other as true loops do. With group_size 1 loops are independent.
//
// Needs at least 3 poses; a loop is an edge that does not join pose k to pose k + 1. Cost: linear.

#include <cstdint>

#include "estimator/core/status.hpp"
#include "mapping/pose_graph/pose_graph.hpp"

namespace swiftlet {

struct OutlierInjection {
  std::uint32_t count = 0;       ///< false loops to add; need not be a multiple of the group size
  std::uint64_t seed = 1;        ///< of swiftlet::Random
  std::uint32_t group_size = 1;  ///< mutually consistent loops; 1: independent
};

/// An edge of the graph that is part of the odometry chain.
template <typename Pose>
bool isOdometry(const RelativePose<Pose>& edge) {
  return edge.to == edge.from + 1;
}

/// Number of false loops that make up `share` (in [0, 1)) of all loops together with `true_loops`, rounded.
std::uint32_t outlierCount(std::uint32_t true_loops, double share);

/// Appends the false loops after the existing edges. kInvalidInput, with nothing added, if the graph has
/// fewer than 3 poses or no edge, or a group does not fit its poses. Graphs without initial poses need them
/// first, because `graph.poses` bounds the scene.
template <typename Pose>
Status injectOutliers(const OutlierInjection& injection, PoseGraph<Pose>& graph);

}  // namespace swiftlet
