#pragma once
// Reads a log's IMU samples one at a time in the sensor's own axes, also from logs of several hours.
//
// Logs: EuRoC folders (imu0 is enough) and archives of them, an imu0/data.csv alone (also packed by xz), bags
// and recordings. No calibration is needed. Samples whose stamps do not rise are omitted. Memory: one row for
// files on disk; the text for archives and packed files; 24 bytes per message for bags. Errors: InputError.

#include <functional>
#include <string>
#include <vector>

#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

/// Omitted samples are reported in `warnings`.
void eachImuSample(const std::string& log, const std::function<void(const ImuSample&)>& take,
                   std::vector<std::string>& warnings);

}  // namespace swiftlet
