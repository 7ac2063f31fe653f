#pragma once
// Views of further images of one instant: the depth image of a sensor, and the labels that a segmentation
// network gives to camera 0's image. Either may be missing. Does not own the data.

#include "estimator/core/image_view.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/depth_image.hpp"

namespace swiftlet {

struct SceneImages {
  Stamp stamp;           ///< of the corresponding image of camera 0
  DepthImageView depth;  ///< `depth.depth` null: none
  ImageView labels;      ///< one value per pixel, in camera 0's raw geometry; empty: none

  [[nodiscard]] bool empty() const { return depth.depth == nullptr && labels.empty(); }
};

}  // namespace swiftlet
