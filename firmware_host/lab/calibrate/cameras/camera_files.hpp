#pragma once
// Calibrated cameras as text for people and as files for other programs.

#include <string>

#include "firmware_host/lab/calibrate/cameras/camera_solution.hpp"

namespace swiftlet {

/// A line per fact, with standard deviations; empty if no lens was found.
[[nodiscard]] std::string describe(const CameraSolution& solution);

/// Kalibr's camchain.yaml without an IMU: camera_model, distortion_model, intrinsics, resolution, T_cn_cnm1.
[[nodiscard]] std::string camchainYaml(const CameraSolution& solution);

}  // namespace swiftlet
