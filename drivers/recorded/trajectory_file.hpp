#pragma once
// Reads and writes trajectory files. The format is detected by content:
//  - TUM: `t tx ty tz qx qy qz qw`, separated by blanks. Stamps above 1e14 are nanoseconds, below 1e11
//    seconds, between them refused; the first row decides for the file.
//  - EuRoC csv (state_groundtruth_estimate0, OpenVINS' and other variants): `ns, p xyz, q wxyz` and, with 17
//    columns, `v xyz, gyro bias xyz, accel bias xyz`.
// Quaternions further than 1e-3 from unit norm are bad rows. Bad rows are skipped and counted; files with too
// many are refused (CsvReader). Writing: TUM with 9 decimals of the stamp, from integer nanoseconds.

#include <Eigen/Core>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/recorded/log_warnings.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

struct TrajectoryPoint {
  Stamp stamp;
  SE3 T_world_body;
  bool has_motion = false;  ///< velocity and biases are given
  Eigen::Vector3d v_world_body = Eigen::Vector3d::Zero();
  Eigen::Vector3d bias_gyro = Eigen::Vector3d::Zero();
  Eigen::Vector3d bias_accel = Eigen::Vector3d::Zero();
};

using Trajectory = std::vector<TrajectoryPoint>;

/// In time order. InputError names file and line; `counters` and `warnings` receive what was skipped.
Trajectory readTrajectory(const std::string& path, LogCounters& counters, LogWarnings& warnings);
Trajectory readTrajectoryText(const std::string& name, std::string_view text, LogCounters& counters,
                              LogWarnings& warnings);

/// For files written by swiftlet: no row is skipped; the first one that is bad, repeated or out of order is
/// an InputError with its line. `remedy` ends the message.
Trajectory readWholeTrajectory(const std::string& path, const std::string& remedy);

/// Converts poses stamped by the IMU's clock, such as a log's truth, to the clock of the images: t_image =
/// t_imu - `camera_to_imu_shift`.
Trajectory onImageClock(Trajectory poses, Duration camera_to_imu_shift);

/// "sec.nnnnnnnnn", exact.
std::string formatSeconds(Stamp stamp);

/// One TUM line without line end; the quaternion is written with qw >= 0.
std::string formatTum(Stamp stamp, const SE3& T_world_body);

/// Writes a TUM file line by line. InputError if the file cannot be opened or the disk is full.
class TumWriter {
 public:
  explicit TumWriter(const std::string& path);
  ~TumWriter();
  TumWriter(const TumWriter&) = delete;
  TumWriter& operator=(const TumWriter&) = delete;

  void write(Stamp stamp, const SE3& T_world_body);
  void close();

 private:
  std::string path_;
  std::FILE* file_ = nullptr;
};

}  // namespace swiftlet
