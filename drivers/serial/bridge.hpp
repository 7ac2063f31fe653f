#pragma once
// swiftlet's own framing for microcontrollers that connect a bare inertial chip to a serial port and generate
// or observe the camera trigger. Samples and edges have the microcontroller's clock.
//
//   A9 1C | version and kind | length | payload | CRC     all little-endian
//   byte 2: version (1) in the high four bits, kind in the low four; byte 3: bytes of payload
//   CRC-16/CCITT-FALSE from byte 2 to the end of the payload
//   kind 1, sample: time u64 ns | counter u32 | gyro 3 x f32 rad/s | accel 3 x f32 m/s^2 [| temperature f32]
//   kind 2, edge:   time u64 ns | counter u32 | line u8 | rising u8
// Later versions may append fields to a payload; unknown ones are ignored. docs/serial.md has a sender.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "drivers/device/frame_buffer.hpp"
#include "drivers/device/imu_reading.hpp"
#include "drivers/serial/device_count.hpp"
#include "drivers/serial/inertial_frame.hpp"

namespace swiftlet {

class Bridge {
 public:
  static constexpr std::size_t kLongestFrame = 4 + 255 + 2;

  [[nodiscard]] static FrameCheck check(std::span<const std::uint8_t> bytes);
  void read(std::span<const std::uint8_t> frame, InertialFrame& content);
  void forget() { *this = {}; }

 private:
  WrappingCounter<std::uint32_t> samples_;
  WrappingCounter<std::uint32_t> edges_;
};

/// 42 bytes, 46 with the temperature [degC]. Uses the device clock, or the arrival if there is none, and the
/// counter's low 32 bits. Returns the length; 0 if `out` is too short.
std::size_t encodeBridge(const ImuReading& reading, std::optional<float> temperature,
                         std::span<std::uint8_t> out);
/// 20 bytes.
std::size_t encodeBridge(const TriggerEdge& edge, std::span<std::uint8_t> out);

}  // namespace swiftlet
