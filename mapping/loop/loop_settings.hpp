#pragma once
// What a user may ask of loop closure.

namespace swiftlet {

struct LoopSettings {
  /// Least similarity of a place looked at for its words, relative to that of the keyframe with the one
  /// before (DBoW's alpha). Nodes near each other in the map, once a loop is selected, need none.
  double min_similarity = 0.3;
  /// Believe loops only where they agree with the odometry and with each other; false: all that geometry
  /// verifies, for comparison.
  bool consistency = true;
};

}  // namespace swiftlet
