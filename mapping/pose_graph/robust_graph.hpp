#pragma once
// A growing pose graph with false loops: selects the loops and computes the poses that fit them and the
// odometry. It serves flights (mapping/loop) and whole files (robust_solution.hpp).
//
// 1. Odometry joins each pose to the one before; a pose without odometry begins a component.
// 2. Selection (loop_selection.hpp): gate, pairs, largest set, support; updated with every loop.
// 3. The graph of odometry and selected loops is solved.
// 4. If a selected loop does not fit, graduated non-convexity (graduated_selection.hpp) starts from that
//    solution and drops loops that agree in pairs but not all together.
// 5. Loops that were not selected are accepted if they agree with the solution and random loops would be
//    unlikely to. The first test uses the loop's own covariance. The second adds the covariance of the
//    relative pose on the solved graph, because a true loop may be far off a solution that is vague without
//    it; it is made for the `max_reconsidered` loops with fewest conflicts. Then 3 and 4 again, until no loop
//    is accepted.
// 6. Off the flight, settleAnew(): 3 to 5 again from new initial poses, without the dropped loops.
// The limit of the chance follows from the number of loops tested (chance_limit.hpp). In 2, `max_false`
// random loops per graph are accepted on the odometry alone if all loops are random. In 5, at most a share
// `max_false` of the accepted loops is random.
//
// settle() does 3 to 5 in bounded pieces, which a flight spreads over its steps. Until it is at rest the
// poses are intermediate. A loop that arrives during 4 waits for its end.
//
// Gravity. A pose may have the odometry's tilt, which becomes a factor of the graph (gravity_factor.hpp), so
// that a loop cannot tilt the map beyond what the odometry knows. The first pose of a piece with such poses
// is held in heading and position only. If a pose contradicts its own tilt, 3 starts even without a loop: an
// odometry that starts in the air finds the vertical some seconds later.
//
// Frames: T_map_body; the first pose of a component is given, others follow the odometry. Memory: that of
// LoopSelection and 0.9 KiB per loop and pose, reserved by the constructor except for the optimizer's factor.
// Cost: that of the selection to add a loop; an iteration of the optimizer or one of its covariances for each
// of settle()'s `iterations`. Deterministic; no clock. Errors: Status. Not thread safe. docs/pose_graph.md.

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "estimator/core/status.hpp"
#include "mapping/pose_graph/graduated_selection.hpp"
#include "mapping/pose_graph/gravity_factor.hpp"
#include "mapping/pose_graph/loop_selection.hpp"
#include "mapping/pose_graph/pose_graph_optimizer.hpp"
#include "mapping/pose_graph/robust_graph_counters.hpp"

namespace swiftlet {

struct RobustGraphLimits {
  std::uint32_t poses = 0;
  std::uint32_t loops = 0;
};

struct RobustGraphSettings {
  bool robust = true;  ///< false: every loop is accepted, for comparison only
  LoopSelectionSettings selection;
  GraduatedSettings graduated;
  std::uint32_t max_nodes = 0;         ///< of a search for the largest set
  std::uint32_t max_reconsidered = 0;  ///< covariances computed per round of 5
  OptimizeEffort effort;               ///< of a solution
};

/// The settings used everywhere. A loop stays accepted on the solved graph while its chi-squared is below the
/// value that a true loop exceeds with probability 1e-3.
template <typename Pose>
RobustGraphSettings robustGraphSettings();

template <typename Pose>
class RobustGraph {
 public:
  RobustGraph(const RobustGraphLimits& limits, const RobustGraphSettings& settings);

  /// A pose that no odometry joins to those before: the first of a component.
  Status beginComponent(const Pose& T_map_body, const Tilt& tilt = {});
  /// Adds pose number size(). `odometry` joins it and the one before, in either direction.
  Status addPose(const RelativePose<Pose>& odometry, const Tilt& tilt = {});
  /// Holds the pose: solutions do not move it.
  Status hold(std::uint32_t pose) {
    if (pose < size()) known_[pose].held = true;
    return optimizer_.hold(pose, true);
  }
  [[nodiscard]] bool held(std::uint32_t pose) const { return known_[pose].held; }
  /// Sets the pose from which the next solution starts.
  Status setPose(std::uint32_t pose, const Pose& T_map_body) {
    if (!held(pose)) restart(Phase::kSolve);
    return optimizer_.setPose(pose, T_map_body);
  }
  /// LoopSelection::removePose(); the odometry's two edges become their product.
  Status removePose(std::uint32_t pose, std::uint32_t onto);

  /// LoopSelection::addLoop(). `id` identifies the loop until it is released or replaced.
  Status addLoop(const RelativePose<Pose>& loop, std::uint32_t& id);
  /// For many loops at once: LoopSelection::holdLoop() for each, then search() once.
  Status holdLoop(const RelativePose<Pose>& loop, std::uint32_t& id) { return selection_.holdLoop(loop, id); }
  void search();
  /// Removes the loop.
  Status release(std::uint32_t id);

  /// Initial poses (PoseGraphOptimizer::start), for a graph whose poses are not useful yet.
  Status start(StartReport& report) { return optimizer_.start(report); }
  /// Works on 3 to 5 for at most `iterations` of the optimizer. `moved`: poses may have changed. Errors are
  /// the optimizer's; it is then at rest until something changes.
  Status settle(int iterations, bool& moved);
  /// Off the flight, at rest. If loops were dropped, false ones may have led the solution into a wrong
  /// minimum. Solves again from initial poses made of the accepted loops only, as long as that lowers the
  /// cost. A rejected loop costs as much as one at the limit of 4.
  Status settleAnew();
  [[nodiscard]] bool atRest() const { return phase_ == Phase::kRest; }

  [[nodiscard]] std::uint32_t size() const { return selection_.odometry().size(); }
  [[nodiscard]] const Pose& pose(std::size_t k) const { return optimizer_.graph().poses[k]; }
  /// PoseGraphOptimizer::relativeCovariance().
  Status relativeCovariance(std::uint32_t from, std::uint32_t to, PoseMatrix<Pose>& out) {
    return optimizer_.relativeCovariance(from, to, out);
  }
  [[nodiscard]] const OdometryChain<Pose>& odometry() const { return selection_.odometry(); }
  /// Whether the odometry joins pose k to the one before.
  [[nodiscard]] bool linked(std::uint32_t k) const { return step_edges_[k] != kNoEdge; }

  /// Loop ids are 0 to loops() - 1.
  [[nodiscard]] std::uint32_t loops() const { return selection_.held(); }
  [[nodiscard]] const RelativePose<Pose>& loop(std::uint32_t id) const { return selection_.loop(id); }
  [[nodiscard]] bool believed(std::uint32_t id) const { return members_[id].weight == 1; }
  [[nodiscard]] std::uint32_t believed() const { return believed_; }
  [[nodiscard]] LoopVerdict verdict(std::uint32_t id) const;
  /// Weight in the optimizer; empty if the loop has no edge there.
  [[nodiscard]] std::optional<double> weight(std::uint32_t id) const;

  [[nodiscard]] const LoopSelection<Pose>& selection() const { return selection_; }
  /// Poses, odometry, and the loops that took part in a solution since the graph was last rebuilt.
  [[nodiscard]] const PoseGraph<Pose>& graph() const { return optimizer_.graph(); }
  [[nodiscard]] const RobustGraphCounters& counters() const { return counters_; }
  /// Of the last solution.
  [[nodiscard]] const OptimizeReport& solution() const { return solution_; }

 private:
  static constexpr std::uint32_t kNoEdge = 0xffffffffU;
  static constexpr std::uint32_t kNoPose = 0xfffffffeU;  ///< kNoPose + 1 is no pose either
  enum class Phase : std::uint8_t { kRest, kSolve, kGraduate, kSolveAgain, kAskOwn, kAskCovariance };

  /// Given with a pose.
  struct Known {
    Tilt tilt;
    bool held = false;
  };
  /// A loop's role in the solution.
  struct Member {
    std::uint32_t edge = kNoEdge;
    double weight = 0;   ///< 1: accepted; unchanged during 4
    bool taken = false;  ///< selected, or accepted by 5; of weight 0 if 4 dropped it
    bool back = false;   ///< accepted by 5, independent of the selection
  };
  /// A loop that was not selected.
  struct OpenLoop {
    std::uint32_t id = 0;
    std::uint32_t conflicts = 0;  ///< with the loops of the sets
    double log_chance = 0;        ///< of a random loop to agree as well with the present solution
  };

  void forget(std::uint32_t id);
  void follow();
  Status take(std::uint32_t id);
  void setWeight(std::uint32_t id, double weight);
  void gather(std::uint32_t left_out);
  Status assemble();
  Status setGravity(std::uint32_t k);
  [[nodiscard]] bool leans(std::uint32_t k) const;
  void restart(Phase phase);
  void countBelieved();

  Status solve(int& iterations);
  void beginGraduated();
  Status graduate(int& iterations);
  void measureFits();
  void weighNext();
  void endGraduated();
  void dropThinTies();
  void askOwn();
  void orderOpen();
  void askNext(int& iterations);
  [[nodiscard]] bool believeFits();
  [[nodiscard]] bool isOpen(std::uint32_t id) const;

  RobustGraphLimits limits_;
  RobustGraphSettings settings_;
  LoopSelection<Pose> selection_;
  PoseGraphOptimizer<Pose> optimizer_;
  std::vector<std::uint32_t> step_edges_;  ///< edge of each pose to the one before
  std::vector<Known> known_;               ///< of each pose
  std::vector<Member> members_;            ///< by the selection's ids
  std::uint32_t believed_ = 0;

  Phase phase_ = Phase::kRest;
  bool behind_ = false;       ///< the selection changed during 4
  int solve_iterations_ = 0;  ///< of the present solution
  OptimizeReport solution_;
  GraduatedSelection graduated_;
  std::vector<std::uint32_t> graduated_ids_;
  std::vector<double> weights_;      ///< of graduated_ids_, in 4
  std::vector<double> chi_squared_;  ///< of graduated_ids_, in 4
  std::vector<OpenLoop> open_;
  std::size_t next_open_ = 0;
  std::uint32_t covariances_ = 0;    ///< computed in this round
  std::vector<double> log_chances_;  ///< scratch
  std::vector<std::uint64_t> set_;   ///< scratch: bits of the loops in the sets
  PoseGraph<Pose> scratch_;
  RobustGraphCounters counters_;
};

extern template class RobustGraph<SE2>;
extern template class RobustGraph<SE3>;

}  // namespace swiftlet
