#pragma once
// A whole pose graph, as a file holds it, optimized without its false loops by RobustGraph: all loops at
// once, then settled until it is at rest.
//
// Odometry are, of the edges that join pose k to k + 1 (or k + 1 to k), the first of each k; all other edges
// are loops, a second edge between neighbours too. Where there is none a component begins.
//
// Frames and cost: pose_graph.hpp. Errors: kInvalidInput (poses or edges that the optimizer refuses),
// kCapacityReached (more than kMaxFileLoops), kNumerical; `graph.poses` are then as they were. Off the
// flight. Memory: 3/8 of a byte for each pair of loops; time: 0.3 us (space) a pair of those that the
// odometry does not speak against, and a dozen or more solutions. Deterministic; no clock.

#include <cstdint>
#include <span>
#include <vector>

#include "mapping/pose_graph/robust_graph.hpp"

namespace swiftlet {

/// 340 MB of pairs.
inline constexpr std::size_t kMaxFileLoops = 30000;

struct RobustSolution {
  std::vector<bool> is_odometry;      ///< one an edge
  std::vector<LoopVerdict> verdicts;  ///< likewise; kSelected of the odometry
  std::uint32_t components = 0;       ///< of the odometry
  std::uint32_t loops = 0;
  std::uint32_t passed = 0;    ///< the gate
  std::uint32_t selected = 0;  ///< before there was a solution
  std::uint32_t kept = 0;      ///< at the end
  bool exact = true;           ///< the set is proven to be the largest
  StartReport start;
  OptimizeReport solve;  ///< the last solution
  RobustGraphCounters counters;
};

/// `graph.poses` in: first poses, out: those of the solution without the rejected loops. `fixed`: poses that
/// do not move.
template <typename Pose>
Status solveRobustly(const RobustGraphSettings& settings, std::span<const std::uint32_t> fixed,
                     PoseGraph<Pose>& graph, RobustSolution& solution);

/// The number of the edge to each pose from the one before; kNoStep where there is none. Edges must name
/// poses of the graph.
inline constexpr std::uint32_t kNoStep = 0xffffffffU;
template <typename Pose>
std::vector<std::uint32_t> odometryEdges(const PoseGraph<Pose>& graph);

/// The next pose of `graph` as one of `robust`, by its step or as a component's first.
template <typename Pose>
Status addNextPose(const PoseGraph<Pose>& graph, const std::vector<std::uint32_t>& steps,
                   RobustGraph<Pose>& robust);

}  // namespace swiftlet
