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
  /// With consistency: graduated non-convexity on the whole graph in place of the largest set of loops that
  /// agree pair by pair (docs/pose_graph.md section 4).
  bool graduated = false;
};

}  // namespace swiftlet
