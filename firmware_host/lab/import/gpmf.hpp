#pragma once
// Reads accelerometer and gyro of one payload of GoPro's metadata (GPMF).
//
// A payload is a tree of entries: four letters, type, bytes per value, number of values, data; all big endian
// and aligned to four bytes. SCAL divides the values that follow it. ORIN names the axis of each channel
// (lower case: negative); without it the channels are unchanged. TSMP counts the samples since the start.
// Errors: std::nullopt for bytes that are not such a tree. Source: github.com/gopro/gpmf-parser, README.

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace swiftlet {

struct GpmfChannel {
  std::vector<Eigen::Vector3d> values;  ///< in the sensor's axes
  std::uint64_t before = 0;             ///< number of earlier samples since the recording's start
  bool counted = false;                 ///< whether the file gives this number
};

struct GpmfPayload {
  GpmfChannel accel;  ///< m/s^2
  GpmfChannel gyro;   ///< rad/s
};

[[nodiscard]] std::optional<GpmfPayload> readGpmf(std::span<const std::uint8_t> bytes);

}  // namespace swiftlet
