#pragma once
// Focal length by the gyro: with the true one, what is left of the tracks after the gyro's turn is taken off
// points away from one point, as a translation alone moves a scene.

#include <optional>
#include <vector>

#include "firmware_host/inspection/camera_turns.hpp"
#include "firmware_host/inspection/motion_fit.hpp"

namespace swiftlet {

struct FocalFit {
  double ratio = 1;  ///< focal length of the log over that of the calibration
  double sigma = 1;  ///< of the ratio, relative
  double gain = 0;   ///< log likelihood of `ratio` above that of 1
};

/// Distances from epipolar lines are minimized over the focal length, with the gyro's rotations (through
/// `gyro_to_camera`, a rotation
/// times a unit) and the best direction of translation of each turn. Nothing where it is not bracketed.
/// Cost: 2 ms a turn.
std::optional<FocalFit> fitFocal(const std::vector<TrackedImage>& images,
                                 const std::vector<CameraTurn>& turns, const GyroIntegral& gyro,
                                 const MotionFit& fit, const Eigen::Matrix3d& gyro_to_camera,
                                 const CameraModel& camera);

}  // namespace swiftlet
