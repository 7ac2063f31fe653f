#pragma once
// EuRoC/ASL imu0/data.csv: `stamp [ns], gyro x y z [rad/s], accel x y z [m/s^2]`.
//
// Gyro first, unless the header names the accelerometer first. Rows are put in order, repeated stamps,
// text and NaN are skipped and counted; files in g or with the sensors swapped are refused.
// Memory: 56 bytes a sample (12 MB for 18 minutes at 200 Hz).

#include <string>
#include <string_view>
#include <vector>

#include "drivers/recorded/csv_reader.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

std::vector<ImuSample> readImuFile(const std::string& path, LogCounters& counters, LogWarnings& warnings);
std::vector<ImuSample> readImuText(const std::string& name, std::string_view text, LogCounters& counters,
                                   LogWarnings& warnings);

/// Median sample rate [Hz]; 0 for fewer than two samples.
double medianRate(const std::vector<ImuSample>& samples);

/// Sorts by stamp (equal stamps keep their order) and drops repeated stamps; both counted.
void orderSamples(std::vector<ImuSample>& samples, const std::string& name, LogCounters& counters,
                  LogWarnings& warnings);

/// Refuses samples whose size shows another unit or swapped sensors.
void checkUnits(const std::vector<ImuSample>& samples, const std::string& name, LogWarnings& warnings);

}  // namespace swiftlet
