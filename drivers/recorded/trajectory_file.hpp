#pragma once
// Trajectories in files. Reading tells the format by content:
//  - TUM: `t tx ty tz qx qy qz qw`, blanks between; a stamp above 1e14 is taken as nanoseconds, below
//    1e11 as seconds, between is refused; the first row decides for the file.
//  - EuRoC csv (state_groundtruth_estimate0, OpenVINS' and other variants): `ns, p xyz, q wxyz` and,
//    where there are 17 columns, `v xyz, gyro bias xyz, accel bias xyz`.
// Quaternions further than 1e-3 from unit norm are bad rows. Bad rows are skipped and counted, files of
// them refused (CsvReader). Writing: TUM with 9 decimals of the stamp, made from integer nanoseconds.

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

/// For files written by swiftlet: the first row that is bad, repeated or out of order is an InputError with
/// its line; no row is skipped. `remedy` ends the message.
Trajectory readWholeTrajectory(const std::string& path, const std::string& remedy);

/// Poses with stamps of the IMU's clock, as a log's truth has them, with those of the images' clock:
/// t_image = t_imu - `camera_to_imu_shift`.
Trajectory onImageClock(Trajectory poses, Duration camera_to_imu_shift);

/// "sec.nnnnnnnnn", exact.
std::string formatSeconds(Stamp stamp);

/// One TUM line without line end; the quaternion written with qw >= 0.
std::string formatTum(Stamp stamp, const SE3& T_world_body);

/// Writes a TUM file line by line. InputError when the file cannot be opened or the disk is full.
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
