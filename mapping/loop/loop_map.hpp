#pragma once
// The map that loops hold together: nodes in the order of time, the odometry between them, loops, selection,
// optimizer, and what becomes of them when there is no more room.
//
// Nodes that neither odometry nor loops join keep their own world; the map is the first piece's. Full is a
// normal state; the map goes on in the same memory for as long as the flight does:
//
// Nodes. makeRoom() takes one away. Its two neighbours are tied by the product of the two relative poses with
// the covariance of the product: for a node that only the odometry holds the others keep their optimum and
// their covariances (to first order). Its loops are carried to the nearer neighbour along the odometry, whose
// covariance is added to theirs (the odometry's step then counts in both, which says a little too much).
// The node whose loss is least goes, never the newest one:
//   loss = stretch x (1 + loops that hold it) x view,
//   stretch  what the odometry covers between its neighbours: distance / 0.25 m + turn / 0.2 rad + time / 2 s
//            (the spacing of nodes),
//   view     distance / 0.25 m + turn / 0.2 rad to the node that sees most nearly the same, 0.1 to 1.
// So the spacing grows evenly along the flight, views that others repeat go first, loops last. A piece that
// is one node without loops has loss 0. A piece of one node takes its loops with it.
//
// Loops. A new one takes the place of one that is not believed (LoopSelection); when all are, of the one
// whose ends lie nearest to the ends of another (in nodes), which says nearly the same.
//
// Loops that the odometry speaks against are asked again when the map has become better: against the
// optimized graph with its covariance, one a step while the graph is at rest.
//
// With LoopSettings::graduated each new loop starts graduated non-convexity (graduated_selection.hpp) over
// all that the odometry does not speak against, at most kGraduatedSolutions short optimizations; of loops
// between two components fewer than three are not believed.
//
// Memory: reserved by the constructor but for the optimizer's factor; scratch of its analysis. Cost of a
// step: making room is quadratic in nodes (2 ms for 1000), everything else linear but for the search of the
// selection and the optimizer's iterations. No clock; deterministic. Errors: Status.

#include <cstdint>
#include <optional>
#include <vector>

#include "estimator/core/stamp.hpp"
#include "estimator/core/status.hpp"
#include "mapping/loop/loop_settings.hpp"
#include "mapping/pose_graph/graduated_selection.hpp"
#include "mapping/pose_graph/loop_selection.hpp"
#include "mapping/pose_graph/pose_graph_optimizer.hpp"
#include "mapping/pose_graph/pose_tangent.hpp"

namespace swiftlet {

struct LoopLimits {
  std::size_t nodes = 1000;  ///< at three a second five minutes without thinning
  std::size_t loops = 1000;
};

// A keyframe closer than this to the last node in all three shows nothing new.
inline constexpr double kNodeDistance = 0.25;  // m
inline constexpr double kNodeTurn = 0.2;       // rad
inline constexpr double kNodeSeconds = 2;

struct LoopMapCounters {
  std::uint64_t nodes_removed = 0;   ///< for room
  std::uint64_t loops_carried = 0;   ///< to the neighbour of a node that was removed
  std::uint64_t loops_released = 0;  ///< given up for room
  std::uint64_t reconsidered = 0;    ///< asked again
  std::uint64_t taken_back = 0;      ///< of them, believed then
  std::uint64_t optimizations = 0;
  std::uint64_t graduated_solutions = 0;
};

class LoopMap {
 public:
  struct Node {
    Stamp stamp;
    std::uint64_t frame = 0;
    std::uint32_t epoch = 0;
    std::uint32_t place = 0;  ///< the caller's
    SE3 T_world_body;         ///< as the odometry had it then
    bool linked = false;      ///< to the node before
    SE3 T_previous_this;
    PoseMatrix<SE3> covariance = PoseMatrix<SE3>::Zero();  ///< perturbed on the right
  };
  struct Loop {
    Stamp old_stamp;
    Stamp new_stamp;
    std::uint64_t old_frame = 0;  ///< as when it was found
    std::uint64_t new_frame = 0;
    bool carried = false;  ///< to other nodes than these
    bool selected = false;
  };

  LoopMap(const LoopSettings& settings, const LoopLimits& limits);

  [[nodiscard]] std::size_t size() const { return nodes_.size(); }
  [[nodiscard]] bool full() const { return nodes_.size() >= limits_.nodes; }
  [[nodiscard]] const Node& node(std::size_t k) const { return nodes_[k]; }
  [[nodiscard]] const SE3& pose(std::size_t k) const { return optimizer_.graph().poses[k]; }
  void setPlace(std::uint32_t place) { nodes_.back().place = place; }
  /// The node of a keyframe; false where it has none any more.
  [[nodiscard]] bool find(std::uint64_t frame, std::uint32_t epoch, std::uint32_t& k) const;

  /// Takes the node away whose loss is least, and says which it was. False with fewer than three nodes.
  bool makeRoom(Node& left);
  /// Adds a node; where `node.linked`, tied to the last by T_previous_this and covariance, else the first of
  /// a component, at its T_world_body. kCapacityReached: full, see makeRoom(); kInvalidInput: not finite.
  Status add(const Node& node);
  /// The piece that the odometry alone holds together.
  [[nodiscard]] std::uint32_t component(std::uint32_t k) const { return selection_.odometry().component(k); }

  /// Adds a loop from a node to a newer one. `id` holds until another takes its place. kInvalidInput as
  /// LoopSelection's.
  Status addLoop(std::uint32_t from, std::uint32_t to, const SE3& T_from_to,
                 const PoseMatrix<SE3>& covariance, std::uint32_t& id);
  /// Up to `iterations` of the optimizer where there is something to settle, else a rejected loop is asked
  /// again. `moved`: poses may have changed.
  Status settle(int iterations, bool& moved);

  [[nodiscard]] std::uint32_t loops() const { return selection_.held(); }
  [[nodiscard]] const Loop& loop(std::uint32_t id) const { return loops_[id]; }
  /// As carried.
  [[nodiscard]] const RelativePose<SE3>& loopEdge(std::uint32_t id) const { return selection_.loop(id); }
  [[nodiscard]] LoopVerdict verdict(std::uint32_t id) const;
  /// In the optimizer; empty for a loop that was given up, which has no edge there.
  [[nodiscard]] std::optional<double> loopWeight(std::uint32_t id) const;
  [[nodiscard]] std::uint32_t selected() const { return selected_; }
  [[nodiscard]] LoopMapCounters counters() const;
  [[nodiscard]] const PoseGraph<SE3>& graph() const { return optimizer_.graph(); }

 private:
  class Weighting;
  static constexpr std::uint32_t kNoEdge = 0xFFFFFFFF;  ///< of a loop that was given up

  [[nodiscard]] std::uint32_t leastLoss();
  [[nodiscard]] double stretch(std::uint32_t k) const;
  [[nodiscard]] double viewDistance(std::uint32_t k) const;
  [[nodiscard]] std::uint32_t mostRepeatedLoop(const RelativePose<SE3>& added) const;
  Status rebuild();
  void setWeight(std::uint32_t id, double weight);
  void dropReleased();
  void weigh();
  void graduate();
  void dropThinTies();
  [[nodiscard]] bool reconsider();

  LoopSettings settings_;
  LoopLimits limits_;
  LoopSelection<SE3> selection_;
  PoseGraphOptimizer<SE3> optimizer_;
  std::vector<Node> nodes_;
  std::vector<Loop> loops_;                ///< by the selection's ids
  std::vector<std::uint32_t> edges_;       ///< number of each loop's edge
  std::vector<std::uint64_t> asked_;       ///< version at which each loop was last reconsidered
  std::vector<double> weights_;            ///< of graduated non-convexity
  std::vector<double> chi_squared_;        ///< likewise
  std::vector<std::uint32_t> node_loops_;  ///< scratch: loops that hold each node
  PoseGraph<SE3> scratch_;
  std::uint32_t selected_ = 0;
  std::uint32_t next_asked_ = 0;
  std::uint64_t version_ = 1;  ///< raised when the optimizer comes to rest
  bool unsettled_ = false;     ///< the optimizer has not converged since something changed
  LoopMapCounters counters_;
};

}  // namespace swiftlet
