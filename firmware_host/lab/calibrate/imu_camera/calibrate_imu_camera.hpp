#pragma once
// Calibrates camera to IMU, time shift, readout, gravity and the IMU's errors from board corners and inertial
// readings.
//
// Everything is estimated in one batch (batch_problem.hpp), lenses included: a camera calibration at rest
// does not determine a rolling shutter, and fixed lenses would make the other standard deviations too small.
// The length of gravity is given (ImuNoise::gravity), its direction is free: the accelerometer's scale is
// free, and a free length could not be separated from it. Knots of the spline: their distance is halved from
// 0.1 s on while the readings fit better than noise allows, but there are at least four readings per knot: a
// finer spline would follow the IMU's noise. Weights: corner noise from the residuals; the densities of gyro
// and accelerometer are scaled by the residuals (gyro_sigma, accel_sigma), so standard deviations grow with
// them. Random walks as given. Readout: estimated; fixed at zero if it is within four sigma of zero. Reasons
// say what is wrong with a result. Tests: the board's size and a drift between the clocks as additional
// unknowns, both halves of the time against each other, standard deviations, residuals, motion. Cost: 20 to
// 60 s for 60 s of stereo at 20 Hz; memory about 100 MB. Two threads, the same bytes every time.

#include <functional>
#include <optional>
#include <vector>

#include "drivers/target/board_view.hpp"
#include "drivers/target/calibration_target.hpp"
#include "estimator/camera/rig.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "firmware_host/lab/calibrate/imu_camera/imu_camera_solution.hpp"

namespace swiftlet {

struct ImuCameraInput {
  CalibrationTarget target;
  std::vector<BoardView> views;  ///< of all images that show the board, in any order
  std::vector<ImuSample> samples;
  ImuNoise noise;
  bool noise_told = true;   ///< false: the noise is assumed, so larger residuals are no fault
  CameraSolution cameras;   ///< lenses and stereo transform: initial values
  std::optional<Rig> told;  ///< expected position of the IMU, for comparison only
};

/// `progress`: called with the finished share, 0 to 1.
ImuCameraSolution calibrateImuCamera(const ImuCameraInput& input,
                                     const std::function<void(double)>& progress = {});

}  // namespace swiftlet
