#pragma once
// What was found about a rig with an IMU, for people, for flights and for other programs.

#include <string>

#include "drivers/calibration/calibration.hpp"
#include "firmware_host/lab/calibrate/imu_camera/imu_camera_solution.hpp"

namespace swiftlet {

/// A line per value with its standard deviation; empty if nothing was found.
[[nodiscard]] std::string describe(const ImuCameraSolution& solution);

/// As flights read it: lenses, extrinsics, time offset, readout, the IMU's matrices. `noise`: densities as
/// told.
[[nodiscard]] Calibration calibrationOf(const ImuCameraSolution& solution, const ImuNoise& noise);

}  // namespace swiftlet
