#pragma once
// Calibrations that contain only cameras (ROS CameraInfo, OpenCV). An IMU file beside them, with the noise
// and the pose of camera 0, completes the rig. Private to this folder.

#include "drivers/calibration/sensor_fields.hpp"

namespace swiftlet {

struct BareCameras {
  std::string form;
  std::vector<CameraEntry> cameras;  ///< without extrinsics
  std::optional<SE3> T_cam1_cam0;    ///< of a pair that was calibrated together, else empty
};

/// The fields of an IMU file, flat or nested under `imu0` as Kalibr writes it.
[[nodiscard]] YamlField parseImu(const NamedText& imu);

/// Whether an IMU file states that the images of the log are rectified.
[[nodiscard]] bool readsRectified(const YamlField& imu);

/// InputError names what the IMU file lacks and how to write it.
[[nodiscard]] Calibration joinToImu(const BareCameras& bare, const YamlField& imu, Warnings warnings,
                                    const CalibrationOptions& options);

}  // namespace swiftlet
