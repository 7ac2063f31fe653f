#pragma once
// The rig that the vehicle's settings name.

#include "drivers/calibration/calibration.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// Its calibration; InputError naming the setting where they say none.
Calibration vehicleCalibration(const Settings& settings);

/// For what needs sizes and rates alone: the same, or without vehicle.calibration a bare rig
/// (Calibration::bare) as cameras.resolution and imu_link.rate_hz say.
Calibration calibratedOrBareRig(const Settings& settings);

}  // namespace swiftlet
