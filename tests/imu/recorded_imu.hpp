#pragma once
// Real IMU logs with truth for the tests of this room, read from xz files under SWIFTLET_DATA.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "estimator/core/stamp.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet::test {

struct TruthRow {
  Stamp stamp;
  Eigen::Vector3d p;     // m, world
  Eigen::Quaterniond q;  // R_world_body
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  Eigen::Vector3d bias_gyro = Eigen::Vector3d::Zero();
  Eigen::Vector3d bias_accel = Eigen::Vector3d::Zero();
  bool moving = false;  // imu_broad's flag
};

struct RecordedLog {
  std::string name;
  std::vector<ImuSample> imu;
  std::vector<TruthRow> truth;
};

/// The data folder: SWIFTLET_DATA, or ../shared/data beside the source tree.
std::string dataFolder();

/// Why a case is skipped: "no GROUP in FOLDER".
std::string noLogs(const std::string& group);

/// Names of the folders that exist below `group` ("euroc_imu_gt_all", "imu_broad").
std::vector<std::string> logNames(const std::string& group);

/// Reads one log; V1_01 with OpenVINS' corrected truth. Empty when it cannot be read.
RecordedLog readLog(const std::string& group, const std::string& name);

}  // namespace swiftlet::test
