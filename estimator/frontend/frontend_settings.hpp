#pragma once
// Settings of the front-end.

#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct FrontendSettings {
  int pyramid_levels = 4;         ///< 1 to kMaxPyramidLevels
  bool anchor_refinement = true;  ///< also align each track with the patch of its first observation
  bool find_again = true;         ///< search lost landmarks at their predicted positions
  float back_check = 0.5F;        ///< px, largest distance after tracking forward and back
  float min_distance = 14.0F;     ///< px, smallest distance of new features from others
  float min_depth = 0.3F;         ///< m, nearest distance searched by stereo matching
  float stereo_gate = 1.5F;       ///< px, largest distance from the epipolar curve
  float motion_gate = 2.0F;  ///< px, largest distance from the epipolar plane of the frame-to-frame motion
  float keyframe_parallax = 10.F;  ///< px, median without rotation since the last keyframe, for a new one
  float keyframe_survival = 0.8F;  ///< new keyframe if a smaller share of its tracks survives
  Duration min_keyframe_interval = Duration::fromMilliseconds(140);
  Duration max_keyframe_interval = Duration::fromMilliseconds(1000);
};

}  // namespace swiftlet
