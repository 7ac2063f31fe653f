#pragma once
// Where the batch begins: the board's poses, the gyro beside the camera's turns, gravity, a first spline.

#include <optional>
#include <string>
#include <vector>

#include "drivers/target/board_view.hpp"
#include "drivers/target/calibration_target.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "firmware_host/inspection/motion_fit.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_solution.hpp"
#include "firmware_host/lab/calibrate/imu_camera/batch_problem.hpp"

namespace swiftlet {

struct BatchStart {
  BatchData data;
  BatchState state;
  Stamp origin;
  MotionFit fit;
  std::vector<std::string> reasons;  ///< what makes the batch pointless; not empty: `state` is not set
};

/// `spacing` [s]: of the spline's knots. A board that the lens of `cameras` does not fit to within some
/// pixels is left out of the start.
BatchStart startBatch(const CalibrationTarget& target, const std::vector<BoardView>& views,
                      const std::vector<ImuSample>& samples, const ImuNoise& noise,
                      const CameraSolution& cameras, double spacing);

}  // namespace swiftlet
