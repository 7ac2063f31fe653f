#pragma once
// Calibrations as files that the next run reads, for `--calibration` and vehicle.calibration:
// cam0/sensor.yaml, cam1/sensor.yaml and imu0/sensor.yaml (EuRoC).

#include <string>

#include "drivers/calibration/calibration.hpp"
#include "estimator/messages/calibration_estimate.hpp"

namespace swiftlet {

/// `given` with the estimated values in place of its own; each file says their sigmas. `folder` is made;
/// InputError where a file cannot be. `rate_hz`: of the cameras, where the calibration does not say.
void writeEstimatedCalibration(const std::string& folder, const Calibration& given,
                               const CalibrationEstimate& estimate, double rate_hz);

/// `calibration` as it is, whatever it was read from: EuRoC's files, and Kalibr's camchain-imucam.yaml and
/// imu.yaml for other tools. `folder` is made; InputError where a file cannot be.
void writeCalibration(const std::string& folder, const Calibration& calibration);

}  // namespace swiftlet
