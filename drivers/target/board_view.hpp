#pragma once
// The corners of a calibration board seen by one camera in one image.

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct BoardCorner {
  int id = 0;  ///< corner number of CalibrationTarget
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

struct BoardView {
  Stamp stamp;  ///< of the image: mid-exposure, with a rolling shutter that of the middle row
  std::size_t camera = 0;
  std::vector<BoardCorner> corners;  ///< by increasing id
};

}  // namespace swiftlet
