#pragma once
// Which loop closures to believe: those that agree with the odometry, with each other, and not by chance.
//
// 1. Gate. A loop within one component must agree with the chain of the odometry (loop_consistency.hpp): its
//    chi-squared at most that of the settings. One that does not stays held.
// 2. Pairs. A loop that passed is tested against those held (only it: one row and column of the graph of
//    consistency). Loops agree or conflict; those of different pairs of components do neither.
// 3. Set. For each pair of components the largest set of loops that all agree (maximum_clique.hpp). A larger
//    set after a loop arrives must contain it, so only its neighbours are searched; of sets of equal size the
//    one found first stays. The set is a function of the loops in the order of their arrival and of the nodes
//    given for each.
// 4. Support. Where odometry is vague nearly any loop agrees with nearly all others, and agreement proves
//    nothing. A loop of the set is selected when a random one would hardly have passed its gate (chance at
//    most gateChanceLimit(), loop_consistency.hpp), or when at least `min_support` loops agree with it,
//    themselves selected, in pair tests that a random one would hardly have passed. Between two components,
//    where there is no gate, n loops must be left beside m of the largest set that contradicts them (places
//    that look the same) with (n - m)^2 >= min_between (n + m), else none is selected: `min_between` where
//    none contradicts them; two sets that differ by chance select nothing.
//
// Full: a new loop takes the place of the held one that is not selected and agrees with fewest (of equals the
// oldest); when all held are in the sets it is refused (kCapacityReached): all of them say the same already.
// Both are counted.
// Memory: max_loops^2 / 8 x 3 bytes for pairs, support and search, 0.6 KiB a loop, 0.4 KiB a pose, reserved
// by the constructor; 4.8 MiB for 2000 loops and 2000 poses in space. Cost of a loop: a pair test (0.3 us in
// space) for each held one of the same components, and the search (maximum_clique.hpp) within `max_nodes`.
// Deterministic. Not for several threads. Sources: Mangelson et al., ICRA 2018 (pairs and their largest set);
// Rosinol, Abate, Chang, Carlone, "Kimera", ICRA 2020 (odometry check, row by row); support is
// this project's own. docs/pose_graph.md.

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
  /// That a random loop agrees as well with the odometry, for the gate alone to prove the loop: at most this,
  /// and so small that of all loops tested `max_false` would reach it, were all random (chance_limit.hpp).
  double max_gate_chance = 1e-3;
  double max_false = 0.05;  ///< the usual 5 %: one graph of twenty believes a random loop
  /// That a random loop agrees as well with another, for the pair to count as support.
  /// loopSelectionSettings() takes 1e-4 in the plane and 1e-2 in space, where few pairs can prove more
  /// (docs/pose_graph.md).
  double max_pair_chance = 1e-4;
  std::uint32_t min_support = 1;  ///< agreeing loops, where the gate alone is no proof
  std::uint32_t min_between = 3;  ///< loops that tie two components at least, if none contradict them
  bool pairwise = true;           ///< false: all that pass the gate are selected (for comparison)
};

/// The settings used everywhere: a true loop fails each test with probability `tail`, in (0, 1). Small, for a
/// loop must pass against all others.
template <typename Pose>
LoopSelectionSettings loopSelectionSettings(double tail = 1e-6);

/// chi-squared with 3 or 6 degrees of freedom that is exceeded with probability `tail` in (0, 1).
double chiSquaredOfTail(int degrees_of_freedom, double tail);

enum class LoopVerdict : std::uint8_t {
  kSelected,
  kAgainstOdometry,  ///< gate
  kInconsistent,     ///< passed the gate, is not in the largest set
  kUnsupported,      ///< in the set, but chance would agree as well, or too few loops between components
  kReleased,         ///< given up for room
  kAgainstSolution,  ///< selected, but does not fit the solved graph (RobustGraph)
};
inline constexpr std::size_t kLoopVerdicts = 6;

struct LoopSelectionCounters {
  std::uint64_t added = 0;
  std::uint64_t refused = 0;   ///< not finite, no such pose, or full of agreeing loops
  std::uint64_t replaced = 0;  ///< held loops that gave way
  std::uint64_t carried = 0;   ///< loops moved to the pose beside theirs, which was removed
  std::uint64_t released = 0;  ///< given up by release() or removePose()
  std::uint64_t pair_tests = 0;
  std::uint64_t nodes = 0;  ///< visited by searches
};

template <typename Pose>
class LoopSelection {
 public:
  LoopSelection(const LoopSelectionLimits& limits, const LoopSelectionSettings& settings);

  /// The odometry so far; poses are added to it before loops name them.
  OdometryChain<Pose>& odometry() { return chain_; }
  [[nodiscard]] const OdometryChain<Pose>& odometry() const { return chain_; }

  /// Tests the loop and brings sets and selection up to date. `id` is the loop's place, valid until it is
  /// replaced. kInvalidInput (no such pose, not finite, no information) and kCapacityReached change nothing.
  Status addLoop(const RelativePose<Pose>& loop, std::uint32_t max_nodes, std::uint32_t& id);
  /// Tests the loop, but leaves sets and selection to search().
  Status holdLoop(const RelativePose<Pose>& loop, std::uint32_t& id);
  /// One search over all held loops of each pair of components, for many loops at once. The result is a set
  /// of the same size as loop by loop where both are exact, not always the same one.
  void search(std::uint32_t max_nodes);
  /// Gives a held loop up: it leaves pairs and sets (one that others agreed with for its support may take
  /// them out of the selection), and its id is the next to be given to another loop.
  Status release(std::uint32_t id);
  /// Takes a pose out of the odometry, so that there is room for another; poses after it move down by one.
  /// Its loops are carried to `onto`, a pose of the same component: their relative pose goes on along the
  /// odometry between the two, whose covariance is added to theirs; what was found of their pairs stays.
  /// Loops between the two, and all where pose == onto, are released. Not the last pose. Linear in poses and
  /// loops.
  Status removePose(std::uint32_t pose, std::uint32_t onto);
  /// Ids of the selected loops, ascending.
  [[nodiscard]] std::span<const std::uint32_t> selected() const { return selected_; }
  [[nodiscard]] LoopVerdict verdict(std::uint32_t id) const;
  [[nodiscard]] const RelativePose<Pose>& loop(std::uint32_t id) const { return held_[id].loop; }
  [[nodiscard]] const CycleTest& gate(std::uint32_t id) const { return held_[id].gate; }
  /// As it stands to the odometry.
  [[nodiscard]] const ChainedLoop<Pose>& chained(std::uint32_t id) const { return held_[id].chained; }
  [[nodiscard]] std::uint32_t held() const { return static_cast<std::uint32_t>(held_.size()); }
  /// The chance up to which a gate alone proves a loop, with the loops held now; logarithm.
  [[nodiscard]] double gateChanceLimit() const { return log_gate_limit_; }
  /// All sets are proven to be the largest.
  [[nodiscard]] bool exact() const;
  [[nodiscard]] const LoopSelectionCounters& counters() const { return counters_; }
  [[nodiscard]] const ConsistencyGraph& consistency() const { return consistency_; }

 private:
  struct Held {
    RelativePose<Pose> loop;
    ChainedLoop<Pose> chained;
    CycleTest gate;
    double log_chance = 0;        ///< that a random loop passes the gate as well; infinite between components
    double least_log_chance = 0;  ///< of a random loop that agrees perfectly
    std::uint64_t arrival = 0;
    std::uint32_t group = 0;
    bool passed = false;  ///< the gate
    bool released = false;
  };
  /// Loops between the same two components.
  struct Group {
    std::uint32_t from = 0;
    std::uint32_t to = 0;
    std::uint32_t size = 0;  ///< of its set
    bool exact = true;
    std::uint32_t rival = 0;  ///< size of the largest set that speaks against it; between components
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
  ConsistencyGraph support_;  ///< of the agreeing pairs those that chance would not make agree
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
