#pragma once
// The map of loop closure in bounded memory: a RobustGraph of nodes in order of time, which removes nodes and
// loops when it is full.
//
// Nodes that neither odometry nor loops join keep their own world; the map frame is that of the first piece.
// Being full is a normal state, and the map continues in the same memory for the whole flight.
//
// Nodes. makeRoom() removes one. Its two neighbours are joined by the product of the two relative poses with
// the covariance of the product. If only the odometry held the node, the others keep their optimum and their
// covariances (to first order). Its loops are carried to the nearer neighbour along the odometry, whose
// covariance is added to theirs; that step of the odometry then counts twice.
// The node of least loss is removed, never the newest:
//   loss = stretch x (1 + number of its loops) x view,
//   stretch  odometry between its neighbours: distance / 0.25 m + turn / 0.2 rad + time / 2 s (the spacing of
//            nodes),
//   view     distance / 0.25 m + turn / 0.2 rad to the node of the most similar view, limited to 0.1 to 1.
// The spacing thus grows evenly along the flight, repeated views go first and nodes with loops last. A piece
// of one node without loops has loss 0. If a piece of one node is removed, its loops are removed too.
//
// Loops. A new loop replaces one that is not accepted (LoopSelection). If all are accepted, it replaces the
// one whose ends are nearest (in nodes) to the ends of another, because the two are nearly redundant.
//
// Kept nodes. Nodes of an earlier flight's map come first (addKept). If they are held, only nodes of the
// flight are removed for room.
//
// Memory: reserved by the constructor except for the optimizer's factor and scratch of its analysis. Cost of
// a step: making room is quadratic in nodes (2 ms for 1000); the rest is linear, apart from the search of the
// selection and the optimizer's iterations. No clock; deterministic. Errors: Status.

#include <cstdint>
#include <vector>

#include "estimator/core/stamp.hpp"
#include "estimator/core/status.hpp"
#include "mapping/loop/joined_pieces.hpp"
#include "mapping/loop/loop_map_counters.hpp"
#include "mapping/loop/loop_settings.hpp"
#include "mapping/pose_graph/robust_graph.hpp"

namespace swiftlet {

// A keyframe becomes a node if it is beyond one of these from the last node.
inline constexpr double kNodeDistance = 0.25;  // m
inline constexpr double kNodeTurn = 0.2;       // rad
inline constexpr double kNodeSeconds = 2;

/// Whether two poses of the body are farther apart than the spacing of nodes.
[[nodiscard]] bool viewsDiffer(const SE3& a, const SE3& b);

/// Frame indices and epochs of kept nodes start here; those of a flight stay below.
inline constexpr std::uint64_t kKeptFrames = std::uint64_t{1} << 63U;
inline constexpr std::uint32_t kKeptEpochs = std::uint32_t{1} << 31U;

class LoopMap {
 public:
  struct Node {
    Stamp stamp;
    std::uint64_t frame = 0;
    std::uint32_t epoch = 0;
    std::uint32_t place = 0;  ///< set and used by the caller
    SE3 T_world_body;         ///< the odometry's when the node was added
    Tilt tilt;                ///< the odometry's when the node was added; unknown: no gravity factor
  };
  /// Odometry from the node before.
  struct Link {
    SE3 T_previous_this;
    PoseMatrix<SE3> covariance = PoseMatrix<SE3>::Zero();  ///< perturbed on the right
  };
  struct Loop {
    Stamp old_stamp;
    Stamp new_stamp;
    std::uint64_t old_frame = 0;  ///< when the loop was found
    std::uint64_t new_frame = 0;
    bool carried = false;  ///< the loop now joins other nodes than these
  };

  LoopMap(const LoopSettings& settings, const LoopLimits& limits);

  [[nodiscard]] std::size_t size() const { return nodes_.size(); }
  [[nodiscard]] bool full() const { return nodes_.size() >= limits_.nodes; }
  [[nodiscard]] const Node& node(std::size_t k) const { return nodes_[k]; }
  [[nodiscard]] const SE3& pose(std::size_t k) const { return graph_.pose(k); }
  void setPlace(std::uint32_t place) { nodes_.back().place = place; }
  /// Index of a keyframe's node; false if the node was removed.
  [[nodiscard]] bool find(std::uint64_t frame, std::uint32_t epoch, std::uint32_t& k) const;

  /// Removes the node of least loss and returns it in `left`. False with fewer than three nodes, or if all
  /// but the newest are held.
  bool makeRoom(Node& left);
  /// Adds a node, joined to the last by `link`. Null: the first of a component, at its T_world_body.
  /// kCapacityReached: full, see makeRoom(). kInvalidInput: not finite.
  Status add(const Node& node, const Link* link);
  /// Adds a node of an earlier map, before the flight's first node, at its T_world_body. Its frame and epoch
  /// start from kKeptFrames and kKeptEpochs. `held`: it does not move.
  Status addKept(const Node& node, const Link* link, bool held);
  [[nodiscard]] std::size_t kept() const { return kept_; }
  /// Whether odometry and accepted loops join the two nodes.
  [[nodiscard]] bool joined(std::uint32_t a, std::uint32_t b) const {
    return pieces_.joined(component(a), component(b));
  }
  /// Whether the odometry joins node k to the one before.
  [[nodiscard]] bool linked(std::uint32_t k) const { return graph_.linked(k); }
  /// The piece that the odometry alone holds together and that contains node k.
  [[nodiscard]] std::uint32_t component(std::uint32_t k) const { return graph_.odometry().component(k); }

  /// Adds a loop from a node to a newer one. `id` is valid until the loop is replaced. kInvalidInput as in
  /// LoopSelection.
  Status addLoop(std::uint32_t from, std::uint32_t to, const SE3& T_from_to,
                 const PoseMatrix<SE3>& covariance, std::uint32_t& id);
  /// Releases the loops of the largest sets between this piece and others. Searches again among the
  /// loops that contradicted them.
  void releaseTies(std::uint32_t piece);
  /// RobustGraph::settle(), up to `iterations`. `moved`: poses may have changed.
  Status settle(int iterations, bool& moved);
  /// Covariance of T_from_to on the solved graph, perturbed on the right.
  Status relativeCovariance(std::uint32_t from, std::uint32_t to, PoseMatrix<SE3>& out) {
    return graph_.relativeCovariance(from, to, out);
  }
  [[nodiscard]] bool atRest() const { return graph_.atRest(); }

  [[nodiscard]] std::uint32_t loops() const { return graph_.loops(); }
  [[nodiscard]] const Loop& loop(std::uint32_t id) const { return loops_[id]; }
  /// The edge between the nodes that the loop joins now.
  [[nodiscard]] const RelativePose<SE3>& loopEdge(std::uint32_t id) const { return graph_.loop(id); }
  [[nodiscard]] bool selected(std::uint32_t id) const { return graph_.believed(id); }
  [[nodiscard]] std::uint32_t selected() const { return graph_.believed(); }
  [[nodiscard]] const RobustGraph<SE3>& graph() const { return graph_; }
  [[nodiscard]] LoopMapCounters counters() const;

 private:
  [[nodiscard]] std::uint32_t leastLoss();
  [[nodiscard]] double stretch(std::uint32_t k) const;
  [[nodiscard]] double viewDistance(std::uint32_t k) const;
  [[nodiscard]] std::uint32_t mostRepeatedLoop(const RelativePose<SE3>& added) const;

  LoopLimits limits_;
  RobustGraph<SE3> graph_;
  JoinedPieces pieces_;
  std::vector<Node> nodes_;
  std::size_t kept_ = 0;                   ///< the first `kept_` nodes are of a kept map
  std::vector<Loop> loops_;                ///< by the graph's ids
  std::vector<std::uint32_t> node_loops_;  ///< scratch: number of loops of each node
  std::uint64_t nodes_removed_ = 0;
};

}  // namespace swiftlet
