#pragma once
// The text files of an EuRoC/ASL folder: sensor.yaml and data.csv rows, labels, PLY meshes.

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/simulated/imu_simulator.hpp"
#include "drivers/simulated/spline_trajectory.hpp"
#include "drivers/simulated/world.hpp"
#include "estimator/camera/camera_model.hpp"

namespace swiftlet {

/// sensor.yaml of a camera; `origin` says where the data come from, `extra` lines go at its end.
std::string cameraYaml(const CameraModel& camera, const SE3& T_body_cam, double rate_hz,
                       std::string_view origin, const std::string& extra);
std::string imuYaml(const ImuNoise& noise, std::string_view origin);
/// data.csv of an IMU: its first line, and a line for each sample, both with their ends.
std::string imuCsvHeader();
std::string imuCsvRow(const ImuSample& sample);
/// 17 columns: stamp, p, q (wxyz), v, gyro and accelerometer bias, at the IMU's steps.
std::string groundTruthCsv(const SplineTrajectory& trajectory, const SimulatedImu& imu, Stamp zero,
                           double rate_hz);
std::string labelsCsv();
std::string meshPly(const SurfaceMesh& mesh);

struct LabelledPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();
  std::uint8_t label = 0;
};
std::string pointsPly(const std::vector<LabelledPoint>& points);

/// Throws std::runtime_error naming the file.
void writeText(const std::string& path, const std::string& text);

}  // namespace swiftlet
