#pragma once
// The exact truth of a simulated flight as the text files of an EuRoC/ASL folder: poses, labels, surfaces.

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/simulated/imu_simulator.hpp"
#include "drivers/simulated/spline_trajectory.hpp"
#include "drivers/simulated/world.hpp"

namespace swiftlet {

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
