#pragma once
// Calibrations of cameras alone (ROS CameraInfo, OpenCV): joined to a rig by an IMU file beside them, which
// has the noise and the place of camera 0. Private to this folder.

#include "drivers/calibration/sensor_fields.hpp"

namespace swiftlet {

struct BareCameras {
  std::string form;
  std::vector<CameraEntry> cameras;  ///< without extrinsics
  std::optional<SE3> T_cam1_cam0;    ///< of a pair that was calibrated together
};

/// The fields of an IMU file, flat or nested under `imu0` as Kalibr writes it.
[[nodiscard]] YamlField parseImu(const NamedText& imu);

/// Whether an IMU file states that the images of the log are rectified.
[[nodiscard]] bool readsRectified(const YamlField& imu);

/// InputError names what of the IMU file is missing and how to write it.
[[nodiscard]] Calibration joinToImu(const BareCameras& bare, const YamlField& imu, Warnings warnings,
                                    const CalibrationOptions& options);

}  // namespace swiftlet
