#pragma once
// Motion of the body while the rows of a rolling shutter were read. Zero: global shutter, or unknown.
//
// Rows are read at their own times around the image's stamp, which is that of the middle row (Rig::rowTime).
// There is one mean rate for the rows before the middle and one for those after it; neglecting the angular
// acceleration within 10 ms costs about 0.05 px at 10 rad/s^2. Frames: body = IMU.

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {

struct ScanTurn {
  Eigen::Vector3d before = Eigen::Vector3d::Zero();  ///< rad/s, body axes: rows before the middle
  Eigen::Vector3d after = Eigen::Vector3d::Zero();   ///< rows after it

  /// R_middle_row: from body axes at a row, `seconds` after the middle row, to those at the middle row.
  [[nodiscard]] Eigen::Quaterniond at(double seconds) const {
    return expSo3(seconds * (seconds < 0 ? before : after));
  }
  /// rad/s
  [[nodiscard]] Eigen::Vector3d mean() const { return 0.5 * (before + after); }
};

struct ScanMotion {
  ScanTurn turn;
  Eigen::Vector3d v_body = Eigen::Vector3d::Zero();  ///< m/s, body axes
};

}  // namespace swiftlet
