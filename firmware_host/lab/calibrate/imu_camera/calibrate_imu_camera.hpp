#pragma once
// Camera to IMU, time shift, readout, gravity and the IMU's errors from board corners and inertial readings.
//
// Everything is estimated in one batch (batch_problem.hpp), the lenses too: a camera step that held still
// knows nothing of a rolling shutter, and fixed lenses would make the other standard deviations too small.
// Gravity's length is given (ImuNoise::gravity), its direction is free: the scale of the accelerometer is
// free, and a free length could not be told from it.
// Knots of the spline: halved from 0.1 s on while the readings fit better than noise lets them, never below
// four readings a knot: a finer spline would follow the IMU's noise.
// Weights: corner noise from the residuals; densities of gyro and accelerometer times what the residuals show
// (gyro_sigma, accel_sigma), so that standard deviations grow with them. Random walks as given.
// Readout: estimated; held at zero where it is within four sigma of zero.
// Reasons name what makes a result bad. Tests: the board's size and a drift between the clocks as further
// unknowns, both halves of the time against each other, standard deviations, residuals, motion.
// Cost: 20 to 60 s for 60 s of stereo at 20 Hz; memory about 100 MB. Two threads, same bytes every time.

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
  std::vector<BoardView> views;  ///< of all images that show the board, any order
  std::vector<ImuSample> samples;
  ImuNoise noise;
  bool noise_told = true;   ///< false: assumed, so that residuals above it are no fault
  CameraSolution cameras;   ///< lenses and stereo transform: the start
  std::optional<Rig> told;  ///< where the IMU was thought to be: compared only
};

/// `progress`: called with the share that is done, 0 to 1.
ImuCameraSolution calibrateImuCamera(const ImuCameraInput& input,
                                     const std::function<void(double)>& progress = {});

}  // namespace swiftlet
