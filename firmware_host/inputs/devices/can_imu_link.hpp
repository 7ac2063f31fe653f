#pragma once
// An IMU that sends DroneCAN RawIMU on a CAN interface.

#include <optional>

#include "drivers/can/can_bus.hpp"
#include "drivers/can/raw_imu.hpp"
#include "firmware_host/inputs/devices/imu_link.hpp"
#include "firmware_host/settings/device_settings.hpp"

namespace swiftlet {

class CanImuLink : public ImuLink {
 public:
  explicit CanImuLink(const ImuLinkGroup& settings);

  DeviceFault open() override;
  [[nodiscard]] bool isOpen() const override { return bus_.isOpen(); }
  [[nodiscard]] int fd() const override { return bus_.fd(); }
  DeviceFault receive(Stamp now) override;
  bool next(ImuReading& reading) override;
  [[nodiscard]] std::uint64_t received() const override { return bus_.counters().frames; }
  bool nextRemark(DeviceFault& remark) override;
  [[nodiscard]] nlohmann::ordered_json counters() const override;

 private:
  /// Per round of the thread: a tenth of a second of RawIMU at 1 kHz, so that other work is not delayed.
  static constexpr std::size_t kMostReadings = 128;

  CanBusSettings settings_;
  CanBus bus_;
  bool opened_ = false;
  bool warned_ = false;  ///< about the bus's receive buffer
  RawImuDecoder decoder_;
  std::array<ImuReading, kMostReadings> readings_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
};

}  // namespace swiftlet
