#pragma once
// What was seen at one instant beside the cameras' own images, borrowed: the depth image of a sensor, and
// what a segmentation network makes of camera 0's image. Either may be missing. Owns nothing.

#include "estimator/core/image_view.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/depth_image.hpp"

namespace swiftlet {

struct SceneImages {
  Stamp stamp;           ///< of camera 0's image that it goes with
  DepthImageView depth;  ///< `depth.depth` null: none
  ImageView labels;      ///< one value a pixel, in camera 0's raw geometry; empty: none

  [[nodiscard]] bool empty() const { return depth.depth == nullptr && labels.empty(); }
};

}  // namespace swiftlet
