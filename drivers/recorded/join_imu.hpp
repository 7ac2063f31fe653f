#pragma once
// Joins a gyroscope and an accelerometer that were recorded separately, each with its own rate and stamps as
// in RealSense cameras, into one stream of samples.

#include <cstdint>
#include <vector>

#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

/// Samples at the gyroscope's stamps, with the accelerometer interpolated linearly between its two
/// neighbours. Both inputs in time order. `left_out` counts gyroscope samples without a neighbour within 0.1
/// s on each side.
[[nodiscard]] std::vector<ImuSample> joinImu(const std::vector<ImuSample>& gyro,
                                             const std::vector<ImuSample>& accel, std::uint64_t& left_out);

}  // namespace swiftlet
