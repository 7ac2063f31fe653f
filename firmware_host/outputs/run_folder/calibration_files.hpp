#pragma once
// The calibration that a run found, as files that the next one reads: cam0/sensor.yaml, cam1/sensor.yaml
// and imu0/sensor.yaml (EuRoC), for `--calibration` and vehicle.calibration.

#include <string>

#include "drivers/calibration/calibration.hpp"
#include "estimator/messages/calibration_estimate.hpp"

namespace swiftlet {

/// `given` with the estimated values in place of its own; each file says their sigmas. `folder` is made;
/// InputError where a file cannot be. `rate_hz`: of the cameras, where the calibration does not say.
void writeEstimatedCalibration(const std::string& folder, const Calibration& given,
                               const CalibrationEstimate& estimate, double rate_hz);

}  // namespace swiftlet
