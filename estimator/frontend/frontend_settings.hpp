#pragma once
// What may be changed about the front-end from outside.

#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct FrontendSettings {
  int pyramid_levels = 4;          ///< 1 to kMaxPyramidLevels
  bool anchor_refinement = true;   ///< align each track to the patch of its first sighting, too
  bool find_again = true;          ///< look for lost landmarks where they are predicted
  float back_check = 0.5F;         ///< px: tracked forward and back must end this close
  float min_distance = 14.0F;      ///< px between features when new ones are chosen
  float min_depth = 0.3F;          ///< m: nearest point that stereo matching looks for
  float stereo_gate = 1.5F;        ///< px from the epipolar curve
  float motion_gate = 2.0F;        ///< px from the epipolar plane of the frame-to-frame motion
  float keyframe_parallax = 10.F;  ///< px: median, rotation removed, since the last keyframe
  float keyframe_survival = 0.8F;  ///< keyframe when fewer of the last one's tracks are left
  Duration min_keyframe_interval = Duration::fromMilliseconds(140);
  Duration max_keyframe_interval = Duration::fromMilliseconds(1000);
};

}  // namespace swiftlet
