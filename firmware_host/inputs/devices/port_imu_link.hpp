#pragma once
// An IMU on a serial port. MAVLink's TIMESYNC is asked and answered on the way.

#include <array>
#include <optional>

#include "drivers/serial/imu_decoder.hpp"
#include "drivers/serial/serial_port.hpp"
#include "drivers/timesync/two_way_clock_map.hpp"
#include "firmware_host/inputs/devices/imu_link.hpp"
#include "firmware_host/settings/device_settings.hpp"

namespace swiftlet {

class SerialImuLink : public ImuLink {
 public:
  explicit SerialImuLink(const ImuLinkGroup& settings);

  DeviceFault open() override;
  [[nodiscard]] bool isOpen() const override { return port_.isOpen(); }
  [[nodiscard]] int fd() const override { return port_.descriptor(); }
  void discard() override;
  DeviceFault receive(Stamp now) override;
  bool next(ImuReading& reading) override { return decoder_.next(reading); }
  bool nextEdge(TriggerEdge& edge) override { return decoder_.nextEdge(edge); }
  [[nodiscard]] std::uint64_t received() const override { return decoder_.counters().bytes; }
  [[nodiscard]] std::optional<Stamp> toHost(Stamp device) const override;
  [[nodiscard]] nlohmann::ordered_json counters() const override;

 private:
  DeviceFault exchangeClocks(Stamp now);
  DeviceFault sendTimesync(const mavlink::Timesync& message);

  SerialPort port_;
  ImuDecoder decoder_;
  std::array<std::uint8_t, ImuDecoder::kMostFed> bytes_;
  // MAVLink alone.
  MavlinkSender sender_;
  TwoWayClockMap exchange_;
  Stamp asked_;  ///< when the newest request left; its answer names it
};

}  // namespace swiftlet
