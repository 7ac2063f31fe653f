#pragma once
// Writes calibrations as files for later runs (`--calibration` and vehicle.calibration): cam0/sensor.yaml,
// cam1/sensor.yaml and imu0/sensor.yaml (EuRoC).

#include <string>

#include "drivers/calibration/calibration.hpp"
#include "estimator/messages/calibration_estimate.hpp"

namespace swiftlet {

/// Writes `given` with the estimated values; each file states their sigmas. Creates `folder`; InputError if a
/// file cannot be written. `rate_hz`: of the cameras, if the calibration does not give it.
void writeEstimatedCalibration(const std::string& folder, const Calibration& given,
                               const CalibrationEstimate& estimate, double rate_hz);

/// Writes `calibration`, of any source format, as EuRoC's files and as Kalibr's camchain-imucam.yaml and
/// imu.yaml for other tools. `origin` says in the sensors' files where the values are from. Creates `folder`;
/// InputError if a file cannot be written.
void writeCalibration(const std::string& folder, const Calibration& calibration,
                      const std::string& origin = "as given");

}  // namespace swiftlet
