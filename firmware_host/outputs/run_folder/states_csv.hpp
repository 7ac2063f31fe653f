#pragma once
// states.csv: one row per keyframe, when it leaves the window or at the end of the run.
//
// The first 17 columns are those of EuRoC's ground truth (stamp, p, q wxyz, v, gyro bias, accel bias), so
// readers of such files accept it. Then the covariance's diagonal in the order phi, p, v, bg, ba (rad^2, m^2,
// (m/s)^2, ...), the upper triangle of the 6 x 6 pose block (phi, p) row by row without its diagonal, health,
// epoch, and the keyframe's figures.

#include <string>
#include <vector>

#include "estimator/messages/odometry_output.hpp"

namespace swiftlet {

/// The header line, beginning with '#'.
std::string statesHeader();

/// One row without line end; numbers in full precision.
std::string statesRow(const KeyframeState& keyframe);

/// A row as it was stored.
struct StoredState {
  Stamp stamp;
  SE3 T_world_body;
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();  ///< of (phi, p)
  Eigen::Vector3d v_world_body = Eigen::Vector3d::Zero();
  Eigen::Vector3d bias_gyro = Eigen::Vector3d::Zero();
  Eigen::Vector3d bias_accel = Eigen::Vector3d::Zero();
  /// Diagonal of the whole covariance: phi, p, v, bg, ba.
  Eigen::Matrix<double, kStateDim, 1> variances = Eigen::Matrix<double, kStateDim, 1>::Zero();
  bool has_figures = false;  ///< false: the figures are missing or not numbers
  FrameStatistics figures;   ///< of the keyframe
};

/// Reads a states.csv in time order; InputError names file and line.
std::vector<StoredState> readStates(const std::string& path);

/// All rows of the file. Of the covariance only the pose block and the diagonal are stored; the rest is zero.
/// InputError with the line of the first bad row. Empty for a file that has only a header.
std::vector<KeyframeState> readKeyframes(const std::string& path);

}  // namespace swiftlet
