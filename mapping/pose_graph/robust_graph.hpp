#pragma once
// A pose graph that grows and some of whose loops are false: which to believe, and the poses that these hold
// together. In flight (mapping/loop) and for whole files (robust_solution.hpp) it is this class that decides.
//
// 1. Odometry joins each pose to the one before; a pose without begins a component.
// 2. Selection (loop_selection.hpp): gate, pairs, largest set, support. Anew with every loop.
// 3. The graph of odometry and selected loops is solved.
// 4. Graduated non-convexity (graduated_selection.hpp) on these loops, from that solution, where one of them
//    does not fit it: drops those that agree in pairs but not all together.
// 5. Loops that were not selected come back when they agree with the solution and chance would not, by one of
//    two tests: with the loop's own covariance alone; or, for the `max_reconsidered` that contradict fewest
//    of the others, with that of the relative pose on the solved graph added (a true loop may be far off a
//    solution without it where that is vague). Then 3 and 4 again, until no loop comes back.
// 6. Off the flight, settleAnew(): 3 to 5 again from first poses without those that were dropped.
// How small a chance must be follows from how many loops are tested and how many agree (chance_limit.hpp): in
// 2 such that `max_false` random loops a graph are believed on the odometry alone, were all random; in 5 such
// that of those coming back no larger share is random, and a random one comes back to `max_false` of the
// graphs from which no true loop is missing.
//
// settle() does 3 to 5 in bounded pieces, so that a flight can spread them over its steps; until it is at
// rest the poses are those of the work in progress. A loop that arrives while 4 is at work waits for its end.
//
// Gravity. A pose may come with the odometry's tilt; what the accelerometer says of it is a factor of the
// graph (gravity_factor.hpp), so that a loop cannot tilt the map beyond what the odometry knows. Of a piece
// with such poses the first one is held in heading and position alone. A pose that arrives and leans against
// its own tilt sets 3 to work also where there is no loop: an odometry that starts in the air finds the
// vertical some seconds later.
//
// Frames: T_map_body; a component's first pose is given, others follow the odometry. Memory: reserved by the
// constructor but for the optimizer's factor: that of LoopSelection, and 0.9 KiB a loop and pose. Cost:
// adding a loop, that of the selection; settle(), an iteration of the optimizer or one of its covariances for
// each of `iterations`. Deterministic; no clock. Errors: Status. Not for several threads. docs/pose_graph.md.

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "estimator/core/status.hpp"
#include "mapping/pose_graph/graduated_selection.hpp"
#include "mapping/pose_graph/gravity_factor.hpp"
#include "mapping/pose_graph/loop_selection.hpp"
#include "mapping/pose_graph/pose_graph_optimizer.hpp"

namespace swiftlet {

struct RobustGraphLimits {
  std::uint32_t poses = 0;
  std::uint32_t loops = 0;
};

struct RobustGraphSettings {
  bool robust = true;  ///< false: every loop is believed, for comparison
  LoopSelectionSettings selection;
  GraduatedSettings graduated;
  std::uint32_t max_nodes = 0;         ///< of a search for the largest set
  std::uint32_t max_reconsidered = 0;  ///< covariances asked for in 5, a round
  OptimizeEffort effort;               ///< of a solution
};

/// The settings used everywhere. A loop stays on the solved graph while its chi-squared is one that a true
/// loop exceeds with probability 1e-3.
template <typename Pose>
RobustGraphSettings robustGraphSettings();

struct RobustGraphCounters {
  std::uint64_t optimizations = 0;        ///< calls of the optimizer
  std::uint64_t graduated_solutions = 0;  ///< of them, those of 4
  std::uint64_t reconsidered = 0;         ///< loops compared with a solution, 5
  std::uint64_t taken_back = 0;           ///< of them, those that came back
};

template <typename Pose>
class RobustGraph {
 public:
  RobustGraph(const RobustGraphLimits& limits, const RobustGraphSettings& settings);

  /// A pose that no odometry joins to those before.
  Status beginComponent(const Pose& T_map_body, const Tilt& tilt = {});
  /// The next pose: `odometry` joins it, number size(), and the one before, in either direction.
  Status addPose(const RelativePose<Pose>& odometry, const Tilt& tilt = {});
  /// The pose does not move.
  Status hold(std::uint32_t pose) {
    if (pose < size()) known_[pose].held = true;
    return optimizer_.hold(pose, true);
  }
  [[nodiscard]] bool held(std::uint32_t pose) const { return known_[pose].held; }
  /// Where the next solution begins.
  Status setPose(std::uint32_t pose, const Pose& T_map_body) {
    if (!held(pose)) restart(Phase::kSolve);
    return optimizer_.setPose(pose, T_map_body);
  }
  /// LoopSelection::removePose(); the odometry's two edges become their product.
  Status removePose(std::uint32_t pose, std::uint32_t onto);

  /// LoopSelection::addLoop(): `id` is the loop's until it is released or gives way to another.
  Status addLoop(const RelativePose<Pose>& loop, std::uint32_t& id);
  /// For many loops at once: LoopSelection::holdLoop() for each, then search() once.
  Status holdLoop(const RelativePose<Pose>& loop, std::uint32_t& id) { return selection_.holdLoop(loop, id); }
  void search();
  /// Gives the loop up.
  Status release(std::uint32_t id);

  /// First poses from nothing (PoseGraphOptimizer::start), for a graph whose poses mean little yet.
  Status start(StartReport& report) { return optimizer_.start(report); }
  /// Works on 3 to 5, at most `iterations` of the optimizer. `moved`: poses may have changed. The
  /// optimizer's errors; it is then at rest until something changes.
  Status settle(int iterations, bool& moved);
  /// Off the flight, at rest. Where loops were dropped, false ones may have led the solution into a wrong
  /// minimum: begins again from first poses out of the believed ones alone, as long as that lowers the cost.
  /// A loop that is not believed costs as much as one at the limit of 4.
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

  /// Loops have the ids 0 to loops() - 1.
  [[nodiscard]] std::uint32_t loops() const { return selection_.held(); }
  [[nodiscard]] const RelativePose<Pose>& loop(std::uint32_t id) const { return selection_.loop(id); }
  [[nodiscard]] bool believed(std::uint32_t id) const { return members_[id].weight == 1; }
  [[nodiscard]] std::uint32_t believed() const { return believed_; }
  [[nodiscard]] LoopVerdict verdict(std::uint32_t id) const;
  /// In the optimizer; empty where the loop has no edge there.
  [[nodiscard]] std::optional<double> weight(std::uint32_t id) const;

  [[nodiscard]] const LoopSelection<Pose>& selection() const { return selection_; }
  /// Poses, odometry and the loops that took part in a solution since the graph was last built anew.
  [[nodiscard]] const PoseGraph<Pose>& graph() const { return optimizer_.graph(); }
  [[nodiscard]] const RobustGraphCounters& counters() const { return counters_; }
  /// Of the last solution.
  [[nodiscard]] const OptimizeReport& solution() const { return solution_; }

 private:
  static constexpr std::uint32_t kNoEdge = 0xffffffffU;
  static constexpr std::uint32_t kNoPose = 0xfffffffeU;  ///< and the next number
  enum class Phase : std::uint8_t { kRest, kSolve, kGraduate, kSolveAgain, kAskOwn, kAskCovariance };

  /// Of a pose, from elsewhere.
  struct Known {
    Tilt tilt;
    bool held = false;
  };
  /// A loop's part in the solution.
  struct Member {
    std::uint32_t edge = kNoEdge;
    double weight = 0;   ///< 1: believed; while 4 is at work as before
    bool taken = false;  ///< selected, or come back; of weight 0 where 4 has dropped it
    bool back = false;   ///< by 5: stays whatever the selection says
  };
  /// A loop that was not selected.
  struct OpenLoop {
    std::uint32_t id = 0;
    std::uint32_t conflicts = 0;  ///< with the loops of the sets
    double log_chance = 0;        ///< beside the present solution
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
  std::vector<std::uint32_t> step_edges_;  ///< of each pose, to the one before
  std::vector<Known> known_;               ///< of each pose
  std::vector<Member> members_;            ///< by the selection's ids
  std::uint32_t believed_ = 0;

  Phase phase_ = Phase::kRest;
  bool behind_ = false;       ///< the selection has changed while 4 was at work
  int solve_iterations_ = 0;  ///< of the present solution
  OptimizeReport solution_;
  GraduatedSelection graduated_;
  std::vector<std::uint32_t> graduated_ids_;
  std::vector<double> weights_;      ///< of graduated_ids_, in 4
  std::vector<double> chi_squared_;  ///< likewise
  std::vector<OpenLoop> open_;
  std::size_t next_open_ = 0;
  std::uint32_t covariances_ = 0;    ///< asked for in this round
  std::vector<double> log_chances_;  ///< scratch
  std::vector<std::uint64_t> set_;   ///< scratch: bits of the loops in the sets
  PoseGraph<Pose> scratch_;
  RobustGraphCounters counters_;
};

extern template class RobustGraph<SE2>;
extern template class RobustGraph<SE3>;

}  // namespace swiftlet
