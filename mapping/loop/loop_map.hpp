#pragma once
// The map that loops hold together: a RobustGraph of nodes in the order of time, and what becomes of nodes
// and loops when there is no more room.
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
// Kept nodes. Those of an earlier flight's map come first (addKept). Where they are held they stay, and only
// the flight's nodes leave for room.
//
// Memory: reserved by the constructor but for the optimizer's factor; scratch of its analysis. Cost of a
// step: making room is quadratic in nodes (2 ms for 1000), everything else linear but for the search of the
// selection and the optimizer's iterations. No clock; deterministic. Errors: Status.

#include <cstdint>
#include <vector>

#include "estimator/core/stamp.hpp"
#include "estimator/core/status.hpp"
#include "mapping/loop/joined_pieces.hpp"
#include "mapping/loop/loop_settings.hpp"
#include "mapping/pose_graph/robust_graph.hpp"

namespace swiftlet {

struct LoopLimits {
  std::size_t nodes = 1000;  ///< at three a second five minutes without thinning
  std::size_t loops = 1000;
};

// A keyframe closer than this to the last node in all three shows nothing new.
inline constexpr double kNodeDistance = 0.25;  // m
inline constexpr double kNodeTurn = 0.2;       // rad
inline constexpr double kNodeSeconds = 2;

/// Frame indices and epochs of kept nodes begin here: those of a flight stay below.
inline constexpr std::uint64_t kKeptFrames = std::uint64_t{1} << 63U;
inline constexpr std::uint32_t kKeptEpochs = std::uint32_t{1} << 31U;

struct LoopMapCounters {
  std::uint64_t nodes_removed = 0;   ///< for room
  std::uint64_t loops_carried = 0;   ///< to the neighbour of a node that was removed
  std::uint64_t loops_released = 0;  ///< given up for room
  RobustGraphCounters graph;
};

class LoopMap {
 public:
  struct Node {
    Stamp stamp;
    std::uint64_t frame = 0;
    std::uint32_t epoch = 0;
    std::uint32_t place = 0;  ///< the caller's
    SE3 T_world_body;         ///< as the odometry had it then
    Tilt tilt;                ///< likewise; not known: no gravity factor
  };
  /// The odometry from the node before.
  struct Link {
    SE3 T_previous_this;
    PoseMatrix<SE3> covariance = PoseMatrix<SE3>::Zero();  ///< perturbed on the right
  };
  struct Loop {
    Stamp old_stamp;
    Stamp new_stamp;
    std::uint64_t old_frame = 0;  ///< as when it was found
    std::uint64_t new_frame = 0;
    bool carried = false;  ///< to other nodes than these
  };

  LoopMap(const LoopSettings& settings, const LoopLimits& limits);

  [[nodiscard]] std::size_t size() const { return nodes_.size(); }
  [[nodiscard]] bool full() const { return nodes_.size() >= limits_.nodes; }
  [[nodiscard]] const Node& node(std::size_t k) const { return nodes_[k]; }
  [[nodiscard]] const SE3& pose(std::size_t k) const { return graph_.pose(k); }
  void setPlace(std::uint32_t place) { nodes_.back().place = place; }
  /// The node of a keyframe; false where it has none any more.
  [[nodiscard]] bool find(std::uint64_t frame, std::uint32_t epoch, std::uint32_t& k) const;

  /// Takes the node away whose loss is least, and says which it was. False with fewer than three nodes.
  bool makeRoom(Node& left);
  /// Adds a node, tied to the last by `link`; null: the first of a component, at its T_world_body.
  /// kCapacityReached: full, see makeRoom(); kInvalidInput: not finite.
  Status add(const Node& node, const Link* link);
  /// Before the flight's first node: one of an earlier map, at its T_world_body, with frame and epoch from
  /// kKeptFrames and kKeptEpochs on. `held`: it does not move.
  Status addKept(const Node& node, const Link* link, bool held);
  [[nodiscard]] std::size_t kept() const { return kept_; }
  /// Whether odometry and believed loops hold the two in one map.
  [[nodiscard]] bool joined(std::uint32_t a, std::uint32_t b) const {
    return pieces_.joined(component(a), component(b));
  }
  /// Whether the odometry ties node k to the one before.
  [[nodiscard]] bool linked(std::uint32_t k) const { return graph_.linked(k); }
  /// The piece that the odometry alone holds together.
  [[nodiscard]] std::uint32_t component(std::uint32_t k) const { return graph_.odometry().component(k); }

  /// Adds a loop from a node to a newer one. `id` holds until another takes its place. kInvalidInput as
  /// LoopSelection's.
  Status addLoop(std::uint32_t from, std::uint32_t to, const SE3& T_from_to,
                 const PoseMatrix<SE3>& covariance, std::uint32_t& id);
  /// RobustGraph::settle(): up to `iterations` of its work. `moved`: poses may have changed.
  Status settle(int iterations, bool& moved);
  /// Of T_from_to, perturbed on the right, on the solved graph.
  Status relativeCovariance(std::uint32_t from, std::uint32_t to, PoseMatrix<SE3>& out) {
    return graph_.relativeCovariance(from, to, out);
  }
  [[nodiscard]] bool atRest() const { return graph_.atRest(); }

  [[nodiscard]] std::uint32_t loops() const { return graph_.loops(); }
  [[nodiscard]] const Loop& loop(std::uint32_t id) const { return loops_[id]; }
  /// As carried.
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
  std::size_t kept_ = 0;                   ///< of the nodes, the first
  std::vector<Loop> loops_;                ///< by the graph's ids
  std::vector<std::uint32_t> node_loops_;  ///< scratch: loops that hold each node
  std::uint64_t nodes_removed_ = 0;
};

}  // namespace swiftlet
