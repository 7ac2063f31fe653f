#pragma once
// The corners of a calibration board that one camera saw in one image.

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct BoardCorner {
  int id = 0;  ///< CalibrationTarget's
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

struct BoardView {
  Stamp stamp;  ///< of the image: mid-exposure, of a rolling shutter its middle row's
  std::size_t camera = 0;
  std::vector<BoardCorner> corners;  ///< ids rising
};

}  // namespace swiftlet
