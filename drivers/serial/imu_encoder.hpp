#pragma once
// Encodes readings as the bytes that a sensor would send, for hardware-in-the-loop replay and tests.

#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/device/imu_reading.hpp"
#include "drivers/mavlink/mavlink_frame.hpp"
#include "drivers/serial/imu_decoder.hpp"

namespace swiftlet {

/// HIGHRES_IMU with fresh rates and accelerations, time in whole microseconds.
std::size_t encodeMavlink(const ImuReading& reading, MavlinkSender& sender, std::span<std::uint8_t> out);

/// Encodes a reading in any protocol. What a protocol cannot carry is omitted (counters of VectorNav, MIP and
/// MAVLink) or rounded (values to f32; the clock to 0.1 ms for Xsens, to 1 us for MAVLink).
class ImuEncoder {
 public:
  static constexpr std::size_t kLongestFrame = 80;

  explicit ImuEncoder(ImuProtocol protocol) : protocol_(protocol) {
    // Component id of the autopilot itself, as in PX4.
    sender_.component = 1;
  }
  /// The frame's length; 0 if `out` is too short (kLongestFrame is enough).
  std::size_t encode(const ImuReading& reading, std::span<std::uint8_t> out);

 private:
  ImuProtocol protocol_;
  MavlinkSender sender_;
};

}  // namespace swiftlet
