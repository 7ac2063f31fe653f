#pragma once
// MicroStrain MIP packets (3DM-GX, CX, CV), sensor data set 0x80.
//
// Reads scaled acceleration (sent in g of 9.80665 m/s^2) and rate; otherwise delta angle and delta velocity
// divided by the reference delta time or delta time of the same packet. Device clock, the first one present:
// reference time (ns since power-on), GPS time, the older GPS stamp, external time if flagged valid. GPS
// times contain the week only if it is flagged valid, so they step when the receiver finds it. Axes as the
// sensor's, z down: at rest and level z reads about -9.8. Layout: docs/serial.md. Source: MIP data
// communication protocol, MicroStrain by HBK.

#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/device/frame_buffer.hpp"
#include "drivers/device/imu_reading.hpp"
#include "drivers/serial/inertial_frame.hpp"

namespace swiftlet {

class Mip {
 public:
  static constexpr std::size_t kLongestFrame = 4 + 255 + 2;

  [[nodiscard]] static FrameCheck check(std::span<const std::uint8_t> bytes);
  static void read(std::span<const std::uint8_t> frame, InertialFrame& content);
};

/// Writes one packet: constructor, field() for each field, finish().
class MipWriter {
 public:
  MipWriter(std::span<std::uint8_t> out, std::uint8_t descriptor_set);
  /// `data`: the field without its length and descriptor.
  void field(std::uint8_t descriptor, std::span<const std::uint8_t> data);
  /// The packet's length; 0 if it did not fit into `out` or into a packet.
  std::size_t finish();

 private:
  std::span<std::uint8_t> out_;
  std::size_t length_ = 4;
  bool fits_ = true;
};

/// Reference time, scaled acceleration, scaled rate, 44 bytes. Uses the device clock, or the arrival if there
/// is none. Returns the length; 0 if `out` is too short.
std::size_t encodeMip(const ImuReading& reading, std::span<std::uint8_t> out);

}  // namespace swiftlet
