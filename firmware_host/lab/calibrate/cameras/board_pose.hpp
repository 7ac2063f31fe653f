#pragma once
// The pose of a flat board from one image of a known lens.

#include <optional>

#include "drivers/target/board_view.hpp"
#include "drivers/target/calibration_target.hpp"
#include "estimator/camera/camera_model.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

/// T_cam_board: homography of the bearings (at any angle from the axis), then robust Gauss-Newton on the
/// pixels. Empty for fewer than six corners, collinear corners, or a fit with more than `most_rms` [px].
std::optional<SE3> boardPose(const CalibrationTarget& target, const CameraModel& lens, const BoardView& view,
                             double most_rms);

}  // namespace swiftlet
