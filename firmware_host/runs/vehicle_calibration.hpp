#pragma once
// The rig named in the vehicle's settings.

#include "drivers/calibration/calibration.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// The vehicle's calibration; InputError naming the setting if none is set.
Calibration vehicleCalibration(const Settings& settings);

/// For commands that need only sizes and rates: the vehicle's calibration, or without vehicle.calibration a
/// bare rig (Calibration::bare) from cameras.resolution and imu_link.rate_hz.
Calibration calibratedOrBareRig(const Settings& settings);

}  // namespace swiftlet
