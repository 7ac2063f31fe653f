#pragma once
// Initial values of the batch: the board's poses, comparison of gyro and camera rotations, gravity, a first
// spline.

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
  std::vector<std::string> reasons;  ///< why the batch would fail; if not empty, `state` is not set
};

/// `spacing` [s]: of the spline's knots. Views that the lens of `cameras` does not fit to within some pixels
/// are not used for the start.
BatchStart startBatch(const CalibrationTarget& target, const std::vector<BoardView>& views,
                      const std::vector<ImuSample>& samples, const ImuNoise& noise,
                      const CameraSolution& cameras, double spacing);

}  // namespace swiftlet
