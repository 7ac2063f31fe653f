#pragma once
// What a user may ask of loop closure.

namespace swiftlet {

struct LoopSettings {
  /// Least similarity of a candidate, relative to that of the keyframe with the one before.
  double min_similarity = 0.3;
  /// Believe loops only where they agree with the odometry and with each other; false: all that geometry
  /// verifies, for comparison.
  bool consistency = true;
};

}  // namespace swiftlet
