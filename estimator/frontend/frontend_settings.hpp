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
  float keyframe_parallax = 10.F;  ///< px, median since the last keyframe, without rotation, that makes a
                                   ///< keyframe
  float keyframe_survival = 0.8F;  ///< share of the last keyframe's tracks still alive below which a frame
                                   ///< becomes a keyframe
  Duration min_keyframe_interval = Duration::fromMilliseconds(140);
  Duration max_keyframe_interval = Duration::fromMilliseconds(1000);
};

}  // namespace swiftlet
