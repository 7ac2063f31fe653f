#pragma once
// Focal length from the gyro: with the true focal length, tracks with the gyro's rotation removed move
// towards or away from one point, as under pure translation.

#include <optional>
#include <vector>

#include "firmware_host/inspection/camera_turns.hpp"
#include "firmware_host/inspection/motion_fit.hpp"

namespace swiftlet {

struct FocalFit {
  double ratio = 1;  ///< focal length of the log over the calibrated one
  double sigma = 1;  ///< relative sigma of the ratio
  double gain = 0;   ///< log likelihood of `ratio` minus that of 1
};

/// Minimizes the distances from epipolar lines over the focal length, using the gyro's rotations (through
/// `gyro_to_camera`, a rotation times a unit) and for each turn the best direction of translation. Empty if
/// the minimum is not bracketed. Cost: 2 ms per turn.
std::optional<FocalFit> fitFocal(const std::vector<TrackedImage>& images,
                                 const std::vector<CameraTurn>& turns, const GyroIntegral& gyro,
                                 const MotionFit& fit, const Eigen::Matrix3d& gyro_to_camera,
                                 const CameraModel& camera);

}  // namespace swiftlet
