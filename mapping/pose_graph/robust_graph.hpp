#pragma once
// A pose graph optimized without its false loops: loops are chosen, the graph is solved, and what does not
// fit the solution goes.
//
// 1. Odometry: of the edges that join pose k to k + 1 (or k + 1 to k) the first of each k; all other edges
//    are loops, a second edge between neighbours too. Where there is none a component begins.
// 2. LoopSelection over all loops at once: gate, pairs, largest set, support.
// 3. The graph of odometry and selected loops is solved.
// 4. Graduated non-convexity on these loops, from that solution: drops those that agree in pairs but not all
//    together.
// 5. Loops that were not selected and those that were dropped come back when they agree with the solution and
//    chance would not, by one of two tests: with the loop's own covariance alone; or, for the
//    `max_reconsidered` that contradict fewest of the largest set, with that of the relative pose on the
//    solved graph added (a true loop may be far off a solution without it where that is vague). Then 4
//    again, until no loop comes back.
// How small a chance must be follows from how many loops are tested and how many agree (chance_limit.hpp): in
// 2 such that `max_false` random loops a graph are believed on the odometry alone, were all random; in 5 such
// that of those coming back no larger share is random, and a random one comes back to `max_false` of the
// graphs from which no true loop is missing.
// RobustMethod leaves steps out, for comparison.
//
// Frames and cost: pose_graph.hpp. Errors: kInvalidInput (poses or edges that the optimizer refuses),
// kCapacityReached (more loops pass the gate than `max_candidates`), kNumerical; `graph.poses` are then as
// they were. Off the flight and not incremental: for whole files. Memory: 3/8 of a byte for each pair of
// loops that pass the gate; time: 0.3 us (space) a pair, and a dozen or more solutions. Deterministic; no
// clock. Sources: those of loop_selection.hpp and graduated_selection.hpp; docs/pose_graph.md.

#include <cstdint>
#include <span>
#include <vector>

#include "estimator/core/status.hpp"
#include "mapping/pose_graph/graduated_selection.hpp"
#include "mapping/pose_graph/loop_selection.hpp"
#include "mapping/pose_graph/pose_graph_optimizer.hpp"

namespace swiftlet {

enum class RobustMethod : std::uint8_t {
  kSelectionAndGraduated,  ///< 1 to 5
  kSelection,              ///< 1 to 3
  kGraduated,              ///< 1, then 4 on all loops from the odometry
};

struct RobustGraphSettings {
  RobustMethod method = RobustMethod::kSelectionAndGraduated;
  LoopSelectionSettings selection;
  GraduatedSettings graduated;
  std::uint32_t max_nodes = 0;         ///< of the search for the largest set
  std::uint32_t max_candidates = 0;    ///< loops that pass the gate
  std::uint32_t max_reconsidered = 0;  ///< covariances asked for in 5, a round
  double max_false = 0;                ///< loops believed by chance, in 2 and in 5
  std::size_t max_factor_values = 0;   ///< of the optimizer, PoseGraphLimits
  OptimizeEffort effort;               ///< of the first and the last solution
};

/// The settings used everywhere. A loop stays on the solved graph while its chi-squared is one that a true
/// loop exceeds with probability 1e-3.
template <typename Pose>
RobustGraphSettings robustGraphSettings();

enum class EdgeFate : std::uint8_t {
  kOdometry,
  kKept,
  kAgainstOdometry,  ///< gate
  kInconsistent,     ///< not in the largest set
  kAgainstSolution,  ///< selected, but does not fit the solved graph
  kUnsupported,      ///< of the largest set, but chance would agree as well
};

struct RobustGraphReport {
  std::vector<EdgeFate> fates;   ///< one an edge
  std::uint32_t components = 0;  ///< of the odometry
  std::uint32_t loops = 0;
  std::uint32_t passed = 0;    ///< the gate
  std::uint32_t selected = 0;  ///< after step 2
  std::uint32_t kept = 0;      ///< at the end
  bool exact = true;           ///< the set is proven to be the largest
  StartReport start;
  GraduatedReport graduated;
  OptimizeReport solve;  ///< the last solution
};

/// `graph.poses` in: first poses, out: those of the solution without the rejected loops. `fixed`: poses that
/// do not move.
template <typename Pose>
Status solveRobustly(const RobustGraphSettings& settings, std::span<const std::uint32_t> fixed,
                     PoseGraph<Pose>& graph, RobustGraphReport& report);

/// Step 1 alone: the chain (`max_poses` of it at least as many as there are poses, empty) and which edges
/// make it up.
template <typename Pose>
Status chainOdometry(const PoseGraph<Pose>& graph, OdometryChain<Pose>& chain,
                     std::vector<bool>& is_odometry);

}  // namespace swiftlet
