#pragma once
// Selects the loop closures that agree with the odometry and with each other, and not by chance.
//
// 1. Gate. The chi-squared of a loop within one component against the odometry (loop_consistency.hpp) must be
//    at most that of the settings. A loop that fails stays held.
// 2. Pairs. A loop that passed is tested against the held ones, which adds one row and column to the
//    consistency graph. Loops agree or conflict; loops of different pairs of components do neither.
// 3. Set. For each pair of components the largest set of loops that all agree (maximum_clique.hpp). A larger
//    set after a loop arrives must contain it, so only its neighbours are searched. Among sets of equal size
//    the first found stays. The set depends only on the loops in order of arrival and on `max_nodes` of each.
// 4. Support. If the odometry is vague, nearly any loop agrees with nearly all others, and agreement proves
//    nothing. A loop of the set is selected if a random loop would be unlikely to pass its gate (a limit for
//    the loops held now), or if at least `min_support` selected loops agree with it in pair tests that a
//    random loop would be unlikely to pass. Between two components there is no gate. With n supported loops
//    and m in the largest set that contradicts them (two places that look the same), the n are selected if
//    (n - m)^2 >= min_between (n + m), so `min_between` are enough if none contradicts them; two sets whose
//    sizes differ by chance select nothing.
//
// Full: a new loop replaces the held one that is not selected and agrees with fewest (the oldest of equals).
// If all held loops are in the sets it is refused (kCapacityReached), because it would add little. Both are
// counted.
// Memory: max_loops^2 / 8 x 3 bytes for pairs, support and search, 0.6 KiB a loop, 0.4 KiB a pose, reserved
// by the constructor; 4.8 MiB for 2000 loops and 2000 poses in space. Cost of a loop: a pair test (0.3 us in
// space) for each held one of the same components, and the search (maximum_clique.hpp) within `max_nodes`.
// Deterministic. Not thread safe. Sources: Mangelson et al., ICRA 2018 (pairs and their largest set);
// Rosinol, Abate, Chang, Carlone, "Kimera", ICRA 2020 (odometry check, row by row); support is this project's
// own. docs/pose_graph.md.

#include <cstdint>
#include <span>
#include <vector>

#include "estimator/core/status.hpp"
#include "mapping/pose_graph/consistency_graph.hpp"
#include "mapping/pose_graph/loop_consistency.hpp"
#include "mapping/pose_graph/maximum_clique.hpp"
#include "mapping/pose_graph/odometry_chain.hpp"

namespace swiftlet {

struct LoopSelectionLimits {
  std::uint32_t max_poses = 0;
  std::uint32_t max_loops = 0;
};

struct LoopSelectionSettings {
  double gate_chi_squared =
      0;  ///< chiSquaredOfTail(dof, probability), or the square of a Mahalanobis distance
  double pair_chi_squared = 0;
  /// Largest chance that a random loop agrees as well with the odometry for which the gate alone selects a
  /// loop. The limit is smaller if many loops are tested (`max_false`, chance_limit.hpp).
  double max_gate_chance = 1e-3;
  double max_false = 0.05;  ///< mean number of random loops accepted per graph, if all loops were random
  /// Largest chance that a random loop agrees as well with another for which a pair counts as support.
  /// loopSelectionSettings() takes 1e-4 in the plane and 1e-2 in space, where few pairs can reach less
  /// (docs/experiments/pose_graph.md).
  double max_pair_chance = 1e-4;
  std::uint32_t min_support = 1;  ///< agreeing loops required if the gate alone does not select a loop
  std::uint32_t min_between = 3;  ///< loops required to join two components if none contradicts them
  bool pairwise = true;           ///< false: all that pass the gate are selected (for comparison only)
};

/// The settings used everywhere. A true loop fails each test with probability `tail`, in (0, 1), which is
/// small because a loop must pass against all others.
template <typename Pose>
LoopSelectionSettings loopSelectionSettings(double tail = 1e-6);

/// Chi-squared of 3 or 6 degrees of freedom that is exceeded with probability `tail` in (0, 1).
double chiSquaredOfTail(int degrees_of_freedom, double tail);

enum class LoopVerdict : std::uint8_t {
  kSelected,
  kAgainstOdometry,  ///< failed the gate
  kInconsistent,     ///< passed the gate, not in the largest set
  kUnsupported,  ///< in the set, but random loops would agree as well, or too few loops join the components
  kReleased,     ///< released for room
  kAgainstSolution,  ///< selected, but does not fit the solved graph (RobustGraph)
};
inline constexpr std::size_t kLoopVerdicts = 6;

struct LoopSelectionCounters {
  std::uint64_t added = 0;
  std::uint64_t refused = 0;   ///< not finite, no such pose, or full of agreeing loops
  std::uint64_t replaced = 0;  ///< held loops replaced by new ones
  std::uint64_t carried = 0;   ///< loops moved to a neighbour of their removed pose
  std::uint64_t released = 0;  ///< dropped by release() or removePose()
  std::uint64_t pair_tests = 0;
  std::uint64_t nodes = 0;  ///< visited by searches
};

template <typename Pose>
class LoopSelection {
 public:
  LoopSelection(const LoopSelectionLimits& limits, const LoopSelectionSettings& settings);

  /// The odometry so far; add poses here before loops name them.
  OdometryChain<Pose>& odometry() { return chain_; }
  [[nodiscard]] const OdometryChain<Pose>& odometry() const { return chain_; }

  /// Tests the loop and updates sets and selection. `id` identifies the loop until it is replaced.
  /// kInvalidInput (no such pose, not finite, no information) and kCapacityReached change nothing.
  Status addLoop(const RelativePose<Pose>& loop, std::uint32_t max_nodes, std::uint32_t& id);
  /// Tests the loop, but does not update sets and selection; call search() afterwards.
  Status holdLoop(const RelativePose<Pose>& loop, std::uint32_t& id);
  /// One search over all held loops of each pair of components, for many loops at once. If both are exact,
  /// the set has the same size as loop by loop, but is not always the same.
  void search(std::uint32_t max_nodes);
  /// Removes a held loop from pairs and sets; loops that it supported may become unselected. Its id is the
  /// next to be given to another loop.
  Status release(std::uint32_t id);
  /// Removes a pose from the odometry to make room; poses after it move down by one. Its loops are carried to
  /// `onto`, a pose of the same component: their relative poses are extended along the odometry between the
  /// two, and its covariance is added to theirs. Results of pair tests are kept. Loops between the two, and
  /// all loops of the pose if pose == onto, are released. Not for the last pose. Linear in poses and loops.
  Status removePose(std::uint32_t pose, std::uint32_t onto);
  /// Ids of the selected loops, ascending.
  [[nodiscard]] std::span<const std::uint32_t> selected() const { return selected_; }
  [[nodiscard]] LoopVerdict verdict(std::uint32_t id) const;
  [[nodiscard]] const RelativePose<Pose>& loop(std::uint32_t id) const { return held_[id].loop; }
  [[nodiscard]] const CycleTest& gate(std::uint32_t id) const { return held_[id].gate; }
  /// Prepared for the tests against the odometry.
  [[nodiscard]] const ChainedLoop<Pose>& chained(std::uint32_t id) const { return held_[id].chained; }
  [[nodiscard]] std::uint32_t held() const { return static_cast<std::uint32_t>(held_.size()); }
  /// All sets are proven to be the largest.
  [[nodiscard]] bool exact() const;
  [[nodiscard]] const LoopSelectionCounters& counters() const { return counters_; }
  [[nodiscard]] const ConsistencyGraph& consistency() const { return consistency_; }

 private:
  struct Held {
    RelativePose<Pose> loop;
    ChainedLoop<Pose> chained;
    CycleTest gate;
    double log_chance = 0;        ///< of a random loop to agree as well; infinite between components
    double least_log_chance = 0;  ///< the same with perfect agreement
    std::uint64_t arrival = 0;
    std::uint32_t group = 0;
    bool passed = false;  ///< passed the gate
    bool released = false;
  };
  /// Loops between the same two components.
  struct Group {
    std::uint32_t from = 0;
    std::uint32_t to = 0;
    std::uint32_t size = 0;  ///< of its set
    bool exact = true;
    std::uint32_t rival = 0;  ///< size of the largest set that contradicts it; between components
  };

  Status place(const RelativePose<Pose>& loop, std::uint32_t& id);
  [[nodiscard]] bool findLeast(std::uint32_t& id) const;
  std::uint32_t groupOf(const ChainedLoop<Pose>& chained);
  void testGate(Held& held) const;
  void limitGateChance();
  void testPairs(std::uint32_t id);
  void extend(std::uint32_t id, std::uint32_t max_nodes);
  void searchGroup(std::uint32_t group, std::uint32_t max_nodes);
  void replaceSet(std::uint32_t group);
  void weighRival(std::uint32_t group, std::uint32_t max_nodes);
  void leave(std::uint32_t id);
  void giveUp(std::uint32_t id);
  void carry(RelativePose<Pose>& loop, std::uint32_t pose, std::uint32_t onto) const;
  void select();
  void dropUnsupported();

  LoopSelectionLimits limits_;
  LoopSelectionSettings settings_;
  OdometryChain<Pose> chain_;
  std::vector<Held> held_;
  std::vector<Group> groups_;
  ConsistencyGraph consistency_;
  ConsistencyGraph support_;  ///< agreeing pairs that count as support
  MaximumClique clique_;
  std::vector<std::uint64_t> sets_;    ///< loops in the set of their group
  std::vector<std::uint64_t> chosen_;  ///< bits of selected_
  std::vector<std::uint64_t> scratch_;
  std::vector<std::uint32_t> selected_;
  std::vector<std::uint32_t> carried_;  ///< scratch of removePose()
  std::vector<double> least_chances_;   ///< scratch of limitGateChance()
  double log_gate_limit_ = 0;
  std::uint64_t arrivals_ = 0;
  LoopSelectionCounters counters_;
};

extern template class LoopSelection<SE2>;
extern template class LoopSelection<SE3>;

}  // namespace swiftlet
