#pragma once
// One stream of samples from a gyroscope and an accelerometer that were recorded separately, each with its
// own rate and stamps, as RealSense cameras send them.

#include <cstdint>
#include <vector>

#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

/// Samples at the gyroscope's stamps, the accelerometer interpolated linearly between its two neighbours.
/// Both in time order. `left_out` counts the gyroscope's samples without a neighbour on each side within 0.1
/// s.
[[nodiscard]] std::vector<ImuSample> joinImu(const std::vector<ImuSample>& gyro,
                                             const std::vector<ImuSample>& accel, std::uint64_t& left_out);

}  // namespace swiftlet
