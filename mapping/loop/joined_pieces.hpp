#pragma once
// Tracks which pieces of the graph the accepted loops join, and aligns a piece that was just joined.
//
// A piece is a component of the graph: poses that the odometry alone holds together. A new piece has a world
// of its own, so the first loops to other pieces may place it anywhere, at any angle, where an optimizer must
// not start. It is therefore moved as a whole to where the best of these loops puts it, unless one of them
// fits already. Held pieces do not move.
// Memory: some 12 bytes a component. Cost: loops times pieces. Deterministic; no errors.

#include <cstdint>
#include <vector>

#include "mapping/pose_graph/robust_graph.hpp"

namespace swiftlet {

class JoinedPieces {
 public:
  JoinedPieces();

  /// Updates from the graph's components and accepted loops; aligns components that are newly joined.
  void follow(RobustGraph<SE3>& graph);
  /// Whether follow() found the two components joined. A component newer than that is joined to none.
  [[nodiscard]] bool joined(std::uint32_t a, std::uint32_t b) const {
    return a == b || (a < first_.size() && b < first_.size() && first_[a] == first_[b]);
  }

 private:
  void align(RobustGraph<SE3>& graph);
  void reach(RobustGraph<SE3>& graph, std::uint32_t from, std::uint32_t to);

  double fits_;                        ///< chi-squared up to which a loop fits
  std::vector<std::uint32_t> first_;   ///< of each component: the first component joined with it
  std::vector<std::uint32_t> before_;  ///< first_ before the update
  std::vector<bool> placed_;           ///< by align()
  std::vector<std::uint32_t> queue_;
};

}  // namespace swiftlet
