#pragma once
// Which pieces of the graph its believed loops join, and where a piece lies that was just joined.
//
// A piece is what the odometry alone holds together: a component of the graph. One that begins has a world of
// its own; the first loops that tie it to others find it anywhere, turned by any angle, from where no
// optimizer should start. So it is moved as a whole to where the best of these loops puts it, unless one of
// them fits already. Pieces that are held do not move.
// Memory: 9 bytes a component. Cost: loops times pieces. Deterministic; no errors.

#include <cstdint>
#include <vector>

#include "mapping/pose_graph/robust_graph.hpp"

namespace swiftlet {

class JoinedPieces {
 public:
  JoinedPieces();

  /// The graph's components and believed loops as they are now. Where that joins other components than before
  /// they are aligned.
  void follow(RobustGraph<SE3>& graph);
  /// Two components, as follow() found them; a later one is joined to none.
  [[nodiscard]] bool joined(std::uint32_t a, std::uint32_t b) const {
    return a == b || (a < first_.size() && b < first_.size() && first_[a] == first_[b]);
  }

 private:
  void align(RobustGraph<SE3>& graph);
  void reach(RobustGraph<SE3>& graph, std::uint32_t from, std::uint32_t to);

  double fits_;                        ///< chi-squared up to which a loop fits
  std::vector<std::uint32_t> first_;   ///< of each component, the first of those that it is joined with
  std::vector<std::uint32_t> before_;  ///< first_ as it was
  std::vector<bool> placed_;           ///< by align()
  std::vector<std::uint32_t> queue_;
};

}  // namespace swiftlet
