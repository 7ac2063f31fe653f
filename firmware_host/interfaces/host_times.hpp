#pragma once
// What the host adds to a sensor's message, and how an image gets from a device's memory into a slot.

#include <cstdint>

namespace swiftlet {

/// Times of the host's monotonic clock [s].
struct HostTimes {
  double exposure = 0;  ///< middle of the exposure (IMU: the sample's stamp)
  double arrival = 0;   ///< handed to the estimator
};

/// Writes an image's pixels, grey, 8 bit, rows without padding, to where it is told: once.
struct PixelWriter {
  void (*write)(const void* device, std::uint8_t* pixels) = nullptr;
  const void* device = nullptr;
};

}  // namespace swiftlet
