#pragma once
// User settings of loop closure, and the limits of its map.

#include <cstddef>

namespace swiftlet {

struct LoopSettings {
  /// Least similarity of a candidate found by words, relative to that of the keyframe with its predecessor
  /// (DBoW's alpha). Smaller values verify more candidates. Nodes near each other in the map are compared
  /// without it once a loop is accepted.
  double min_similarity = 0.3;
  /// Reject loops that contradict the odometry, other loops or the solved graph. False: every geometrically
  /// verified loop is used, for comparison only.
  bool consistency = true;
};

struct LoopLimits {
  std::size_t nodes = 1000;  ///< at three nodes a second, five minutes before nodes are removed
  std::size_t loops = 1000;
};

}  // namespace swiftlet
