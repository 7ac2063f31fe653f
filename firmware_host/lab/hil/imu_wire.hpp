#pragma once
// The wire on which a hardware-in-the-loop replay plays an IMU: a pseudo-terminal under the name of the
// serial port in the vehicle's settings, or a CAN interface.

#include <memory>

#include "drivers/device/device_fault.hpp"
#include "drivers/device/imu_reading.hpp"
#include "firmware_host/settings/device_settings.hpp"

namespace swiftlet {

class ImuWire {
 public:
  ImuWire() = default;
  ImuWire(const ImuWire&) = delete;
  ImuWire& operator=(const ImuWire&) = delete;
  virtual ~ImuWire() = default;

  virtual DeviceFault open() = 0;
  /// Takes the device away, as if unplugged; open() brings it back.
  virtual DeviceFault unplug() = 0;
  /// Whether a reader is connected; true on a bus, where it is unknown.
  [[nodiscard]] virtual bool isRead() = 0;
  /// Sends a reading; received bytes are discarded.
  virtual DeviceFault send(const ImuReading& reading) = 0;
  /// Sends bytes that are not a message; nothing on a bus, whose controller would drop them.
  virtual DeviceFault sendGarbage(std::uint64_t seed) = 0;
};

/// Makes the wire named in the settings.
std::unique_ptr<ImuWire> makeImuWire(const ImuLinkGroup& settings);

}  // namespace swiftlet
