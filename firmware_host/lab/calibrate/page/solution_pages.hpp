#pragma once
// The pages of the parts of `swiftlet calibrate`, with the rules for good, usable and repeat.
//
// Repeat: the solution gives reasons against it. Usable: a rule is violated. Good: no rule is violated. The
// page's table lists each rule with the value found. Limits in the image are angles, so they mean the same
// for every lens.

#include <string>

#include "drivers/target/calibration_target.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_solution.hpp"
#include "firmware_host/lab/calibrate/check/check_run.hpp"
#include "firmware_host/lab/calibrate/imu_camera/imu_camera_solution.hpp"
#include "firmware_host/lab/calibrate/imu_noise/imu_noise_run.hpp"
#include "firmware_host/lab/calibrate/page/calibration_page.hpp"

namespace swiftlet {

/// `log`: used in the title.
CalibrationPage cameraPage(const CameraSolution& solution, const CalibrationTarget& target,
                           const std::string& log);
CalibrationPage imuCameraPage(const ImuCameraSolution& solution, const CalibrationTarget& target,
                              const std::string& log);
CalibrationPage imuNoisePage(const ImuNoiseResult& result);
CalibrationPage checkPage(const CheckResult& result);

}  // namespace swiftlet
