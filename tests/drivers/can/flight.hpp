#pragma once
// RawIMU transfers that say which they are: every reading can be told from every other.

#include "drivers/can/raw_imu.hpp"

namespace swiftlet::canflight {

/// Reading `number`: its stamp counts, its integrals follow from it.
inline RawImu imu(std::uint64_t number) {
  RawImu out;
  out.stamp_us = 1'000'000 + 2500 * number;
  out.interval = 0.0025F;
  const auto part = static_cast<float>(number % 4096);
  out.rate_integral = {part * 1e-6F, -part * 2e-6F, 1e-4F};
  out.force_integral = {0, part * 1e-6F, -0.0245F};
  out.rate = out.rate_integral / out.interval;
  out.force = out.force_integral / out.interval;
  return out;
}

inline DroneCanFrames frames(std::uint64_t number, std::uint8_t node, bool fd, std::size_t terms = 0) {
  RawImu raw = imu(number);
  raw.covariance_count = terms;
  std::array<std::uint8_t, kMaxRawImuBytes> bytes = {};
  const std::size_t size = encodeRawImu(raw, fd, bytes);
  DroneCanFrames out;
  encodeTransfer(rawImuType(), 16, node, static_cast<unsigned>(number), fd, {bytes.data(), size}, out);
  return out;
}

/// The number of the reading; -1 where any of its values is not that reading's.
inline std::int64_t numberOf(const ImuReading& reading) {
  if (!reading.device) return -1;
  const std::int64_t us = reading.device->ns / 1000 - 1'000'000;
  if (us < 0 || us % 2500 != 0) return -1;
  const RawImu expected = imu(static_cast<std::uint64_t>(us / 2500));
  const double scale = 1.0 / static_cast<double>(expected.interval);
  const bool same = reading.gyro == Eigen::Vector3d(expected.rate_integral.cast<double>() * scale) &&
                    reading.accel == Eigen::Vector3d(expected.force_integral.cast<double>() * scale);
  return same ? us / 2500 : -1;
}

}  // namespace swiftlet::canflight
