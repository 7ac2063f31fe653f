#pragma once
// VectorNav binary output (VN-100, VN-200, VN-300): groups Common, Time and IMU.
//
// Units as sent are SI, except delta angles in degrees. Axes x forward, y right, z down: at rest and level z
// reads about -9.8. Rates and accelerations: UncompGyro and UncompAccel (or Common's Imu) are preferred to
// AngularRate and Accel, from which the onboard filter subtracts a bias that jumps; the last choice are
// deltas divided by their time. A trigger wired to SyncIn becomes an edge at TimeStartup - TimeSyncIn if
// these and SyncInCnt are sent. Layout: docs/serial.md. Source: VN-100 user manual UM001, chapter 5.

#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/device/frame_buffer.hpp"
#include "drivers/device/imu_reading.hpp"
#include "drivers/serial/device_count.hpp"
#include "drivers/serial/inertial_frame.hpp"

namespace swiftlet {

class VectorNav {
 public:
  /// A frame with every field of the three groups.
  static constexpr std::size_t kLongestFrame = 379;

  [[nodiscard]] static FrameCheck check(std::span<const std::uint8_t> bytes);
  void read(std::span<const std::uint8_t> frame, InertialFrame& content);
  void forget() { *this = {}; }

 private:
  std::uint32_t sync_count_ = 0;
  WrappingCounter<std::uint32_t> sync_counter_;
};

/// TimeStartup and Imu of the Common group, 38 bytes. Uses the device clock, or the arrival if there is none.
/// Returns the length; 0 if `out` is too short.
std::size_t encodeVectorNav(const ImuReading& reading, std::span<std::uint8_t> out);

}  // namespace swiftlet
