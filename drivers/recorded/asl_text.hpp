#pragma once
// Text of the files of an EuRoC/ASL folder, for writers: sensor.yaml, and data.csv of an IMU.

#include <string>
#include <string_view>

#include "drivers/calibration/calibration.hpp"
#include "estimator/camera/camera_model.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

/// sensor.yaml of a camera; `origin` states the source of the data, `extra` lines are appended.
std::string cameraYaml(const CameraModel& camera, const SE3& T_body_cam, double rate_hz,
                       std::string_view origin, const std::string& extra);
/// Lines of a camera's sensor.yaml for a rolling shutter; empty for a global one.
std::string shutterYaml(Duration readout);
/// sensor.yaml of an IMU; `extra` lines are appended.
std::string imuYaml(const ImuNoise& noise, std::string_view origin, const SE3& T_body_imu = SE3(),
                    const std::string& extra = {});
/// Scale and misalignment under Kalibr's keys, for IMU files of Kalibr and EuRoC; empty if there are none.
std::string imuMatricesYaml(const Calibration& calibration);
/// data.csv of an IMU: its header line, and the line of a sample, both with line ends.
std::string imuCsvHeader();
std::string imuCsvRow(const ImuSample& sample);

}  // namespace swiftlet
