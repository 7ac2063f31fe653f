#pragma once
// Optimizes a whole pose graph of a file without its false loops: RobustGraph with all loops at once, settled
// until it is at rest.
//
// The first edge that joins pose k and k + 1, in either direction, is odometry; all other edges are loops,
// including a second edge between neighbours. A pose without odometry begins a component.
//
// Frames and cost: pose_graph.hpp. Errors: kInvalidInput (poses or edges that the optimizer refuses),
// kCapacityReached (more than kMaxFileLoops), kNumerical; `graph.poses` are then unchanged. Off the flight.
// Memory: 3/8 of a byte per pair of loops. Time: 0.3 us (space) per pair of loops that pass the gate, and a
// dozen or more solutions. Deterministic; no clock.

#include <cstdint>
#include <span>
#include <vector>

#include "mapping/pose_graph/robust_graph.hpp"

namespace swiftlet {

/// Takes 340 MB for the pairs.
inline constexpr std::size_t kMaxFileLoops = 30000;

struct RobustSolution {
  std::vector<bool> is_odometry;      ///< one per edge
  std::vector<LoopVerdict> verdicts;  ///< one per edge; kSelected for odometry
  std::uint32_t components = 0;       ///< of the odometry
  std::uint32_t loops = 0;
  std::uint32_t passed = 0;    ///< loops that passed the gate
  std::uint32_t selected = 0;  ///< loops selected before there was a solution
  std::uint32_t kept = 0;      ///< loops accepted at the end
  bool exact = true;           ///< the set is proven to be the largest
  StartReport start;
  OptimizeReport solve;  ///< the last solution
  RobustGraphCounters counters;
};

/// `graph.poses`: initial poses in, poses of the solution without the rejected loops out. `fixed`: poses that
/// do not move.
template <typename Pose>
Status solveRobustly(const RobustGraphSettings& settings, std::span<const std::uint32_t> fixed,
                     PoseGraph<Pose>& graph, RobustSolution& solution);

/// Index of the odometry edge of each pose to the one before; kNoStep if there is none. Edges must name poses
/// of the graph.
inline constexpr std::uint32_t kNoStep = 0xffffffffU;
template <typename Pose>
std::vector<std::uint32_t> odometryEdges(const PoseGraph<Pose>& graph);

/// Adds the next pose of `graph` to `robust`, by its odometry or as the first of a component.
template <typename Pose>
Status addNextPose(const PoseGraph<Pose>& graph, const std::vector<std::uint32_t>& steps,
                   RobustGraph<Pose>& robust);

}  // namespace swiftlet
