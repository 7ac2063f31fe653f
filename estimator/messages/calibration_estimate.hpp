#pragma once
// The calibration in use: the given one, or its estimate where that is switched on.

#include <array>

#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

struct CalibrationEstimate {
  Duration camera_to_imu_shift;  ///< t_imu = t_image + shift
  std::array<SE3, kMaxCameras> T_body_cam;
};

}  // namespace swiftlet
