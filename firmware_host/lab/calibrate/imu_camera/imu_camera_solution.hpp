#pragma once
// Calibration of a rig of cameras and an IMU that moved in front of a board.

#include <Eigen/Core>
#include <string>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_solution.hpp"

namespace swiftlet {

/// A parameter and its standard deviation.
struct SolvedValue {
  std::string name;  ///< "cam0 fx", "T_body_cam0 rotation x", "gyro scale y"
  std::string unit;  ///< "px", "deg", "mm", "ms", "%"
  double value = 0;  ///< in `unit`; for rotations a component of the rotation vector
  double sigma = 0;  ///< in `unit`
};

struct ImuResidual {
  Stamp stamp;
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< rad/s, reading - model
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();  ///< m/s^2
};

struct ImuCameraSolution {
  Rig rig;  ///< body = IMU: its axes are the accelerometer's
  /// reading = matrix true + bias, as in Kalibr; accelerometer lower triangular, gyro full.
  Eigen::Matrix3d gyro_matrix = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d accel_matrix = Eigen::Matrix3d::Identity();
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();      ///< rad/s, mean over the log
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();     ///< m/s^2
  Eigen::Vector3d gravity_board = Eigen::Vector3d::Zero();  ///< m/s^2, board axes
  std::vector<SolvedValue> values;                          ///< every parameter above, with its sigma
  Eigen::MatrixXd covariance;                               ///< of `values`, in their units
  double corner_sigma = 0;                                  ///< px per axis
  double gyro_sigma = 0;                                    ///< residual over the given noise; 1 is expected
  double accel_sigma = 0;
  std::vector<ImuResidual> imu_residuals;
  std::vector<SolvedView> views;
  std::vector<CornerResidual> corners;
  std::vector<std::string> reasons;  ///< why this cannot be trusted; empty: good
};

}  // namespace swiftlet
