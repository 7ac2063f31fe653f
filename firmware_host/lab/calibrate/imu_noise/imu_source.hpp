#pragma once
// The IMU's readings of a log, one at a time and in the sensor's own axes: for logs of hours.
//
// Logs: EuRoC folders (imu0 is enough) and archives of them, an imu0/data.csv alone (packed with xz too),
// bags and recordings. No calibration is needed. Stamps rise: samples that do not are left out.
// Memory: a row for files on disk; archives and packed files their text; bags 24 bytes a message.
// Errors: InputError.

#include <functional>
#include <string>
#include <vector>

#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

/// What was passed over goes to `warnings`.
void eachImuSample(const std::string& log, const std::function<void(const ImuSample&)>& take,
                   std::vector<std::string>& warnings);

}  // namespace swiftlet
