#pragma once
// Xsens MTData2 (MTi 1, 10, 100, 600 series).
//
// Reads PacketCounter, SampleTimeFine (0.1 ms), Acceleration and RateOfTurn in all four number formats,
// AccelerationHR and RateOfTurnHR if both are in one message (without the other two), TriggerIn1 to 3. Not
// read: high-rate items in separate messages (each counts as without a sample), DeltaV and DeltaQ, whose
// interval is not sent. Units SI; sensor axes: the axis that points up reads +9.81 at rest. Layout:
// docs/serial.md. Source: Xsens MT Low-Level Communication Protocol, MT0101P.

#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/device/frame_buffer.hpp"
#include "drivers/device/imu_reading.hpp"
#include "drivers/serial/device_count.hpp"
#include "drivers/serial/inertial_frame.hpp"

namespace swiftlet {

class Xsens {
 public:
  static constexpr std::size_t kLongestData = 2048;
  static constexpr std::size_t kLongestFrame = kLongestData + 7;

  [[nodiscard]] static FrameCheck check(std::span<const std::uint8_t> bytes);
  void read(std::span<const std::uint8_t> frame, InertialFrame& content);
  void forget() { *this = {}; }

 private:
  WrappingClock<std::uint32_t> clock_;  ///< 0.1 ms
  WrappingCounter<std::uint16_t> packets_;
  WrappingCounter<std::uint16_t> trigger_frames_;
};

/// PacketCounter, SampleTimeFine, Acceleration, RateOfTurn as f32, 47 bytes. The clock is rounded down to 0.1
/// ms; counter and clock are cut to their widths. Returns the length; 0 if `out` is too short.
std::size_t encodeXsens(const ImuReading& reading, std::span<std::uint8_t> out);

}  // namespace swiftlet
