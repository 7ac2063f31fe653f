#pragma once
// GoPro's metadata (GPMF), as far as an IMU needs it: accelerometer and gyro of one payload.
//
// A payload is a tree of entries: four letters, type, bytes a value, number of values, data; all big endian
// and aligned to four bytes. SCAL divides the values that follow it, ORIN names the axis of each channel (a
// small letter: negative); without it the channels stay as they are. TSMP counts the samples since the start.
// Errors: std::nullopt for bytes that are no such tree. Source: github.com/gopro/gpmf-parser, README.

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace swiftlet {

struct GpmfChannel {
  std::vector<Eigen::Vector3d> values;  ///< of the sensor's axes
  std::uint64_t before = 0;             ///< samples before these, since the recording's start
  bool counted = false;                 ///< the file says so
};

struct GpmfPayload {
  GpmfChannel accel;  ///< m/s^2
  GpmfChannel gyro;   ///< rad/s
};

[[nodiscard]] std::optional<GpmfPayload> readGpmf(std::span<const std::uint8_t> bytes);

}  // namespace swiftlet
