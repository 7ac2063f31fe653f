#pragma once
// One or two cameras rigidly mounted to the body (= IMU).

#include <algorithm>
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
  /// How much larger the shift can become when it is estimated in flight; zero if it is not estimated.
  Duration shift_margin;
  /// Time from the first to the last row of a rolling shutter, the same for both cameras; zero: global
  /// shutter. The stamp of an image is that of its middle row.
  Duration readout;

  /// How long after an image's stamp, as a time of the IMU's clock, samples are still needed.
  [[nodiscard]] Duration sampleLead() const {
    return std::max(camera_to_imu_shift + shift_margin, Duration{});
  }
  [[nodiscard]] bool rolls() const { return readout.ns != 0; }
  /// Position of row `v` [px] of camera c, from -0.5 (first row) to 0.5 (last row).
  [[nodiscard]] double row(std::size_t c, double v) const { return v / (camera[c].height() - 1) - 0.5; }
  /// Time from the image's stamp to that row [s].
  [[nodiscard]] double rowTime(std::size_t c, double v) const { return readout.seconds() * row(c, v); }
  [[nodiscard]] SE3 T_cam1_cam0() const { return T_body_cam[1].inverse() * T_body_cam[0]; }
  [[nodiscard]] double baseline() const { return T_cam1_cam0().translation.norm(); }
};

}  // namespace swiftlet
