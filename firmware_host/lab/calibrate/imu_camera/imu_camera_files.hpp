#pragma once
// A calibrated rig with an IMU as text for people, and as files for flights and other programs.

#include <array>
#include <string>

#include "drivers/calibration/calibration.hpp"
#include "firmware_host/lab/calibrate/imu_camera/imu_camera_solution.hpp"

namespace swiftlet {

/// A line per value with its standard deviation; empty if nothing was found.
[[nodiscard]] std::string describe(const ImuCameraSolution& solution);

/// The calibration as used by flights: lenses, extrinsics, time offset, readout, the IMU's matrices. `noise`:
/// the given densities. `camera_rate_hz`: of the images; 0: unknown.
[[nodiscard]] Calibration calibrationOf(const ImuCameraSolution& solution, const ImuNoise& noise,
                                        const std::array<double, kMaxCameras>& camera_rate_hz = {});

}  // namespace swiftlet
