#pragma once
// One or two cameras rigidly mounted to the body (= IMU).

#include <array>
#include <cstddef>

#include "estimator/camera/camera_model.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

struct Rig {
  std::size_t camera_count = 0;
  std::array<CameraModel, kMaxCameras> camera;
  std::array<SE3, kMaxCameras> T_body_cam;  ///< camera to body
  /// t_imu = t_image + shift (Kalibr's timeshift_cam_imu), one value for the rig.
  Duration camera_to_imu_shift;

  [[nodiscard]] SE3 T_cam1_cam0() const { return T_body_cam[1].inverse() * T_body_cam[0]; }
  [[nodiscard]] double baseline() const { return T_cam1_cam0().translation.norm(); }
};

}  // namespace swiftlet
