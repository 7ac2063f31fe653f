#pragma once
// An IMU on a serial port, or an autopilot's IMU on a serial port or UDP. With an autopilot, TIMESYNC and the
// sample rate are also negotiated. Other threads' messages over the same link are sent here too, so only one
// thread reads and writes the port.

#include <array>
#include <memory>
#include <optional>
#include <string>

#include "drivers/serial/imu_decoder.hpp"
#include "firmware_host/inputs/devices/autopilot_dialogue.hpp"
#include "firmware_host/inputs/devices/imu_link.hpp"
#include "firmware_host/inputs/devices/sensor_setup.hpp"
#include "firmware_host/interfaces/link_outbox.hpp"
#include "firmware_host/interfaces/link_port.hpp"
#include "firmware_host/settings/device_settings.hpp"

namespace swiftlet {

class PortImuLink : public ImuLink {
 public:
  /// `rate`: sample rate requested from the device [Hz]; 0: not requested. `outbox`: messages of an autopilot
  /// outlet on the same link, or null; must outlive this object. InputError naming imu_link.device.
  explicit PortImuLink(const ImuLinkGroup& settings, double rate = 0, LinkOutbox* outbox = nullptr);

  DeviceFault open() override;
  [[nodiscard]] bool isOpen() const override { return port_.isOpen(); }
  bool restart() override;
  [[nodiscard]] int fd() const override { return port_.descriptor(); }
  [[nodiscard]] int wakeFd() const override { return outbox_ != nullptr ? outbox_->descriptor() : -1; }
  void discard() override;
  DeviceFault receive(Stamp now) override;
  DeviceFault send() override;
  bool next(ImuReading& reading) override { return decoder_.next(reading); }
  bool nextEdge(TriggerEdge& edge) override { return decoder_.nextEdge(edge); }
  [[nodiscard]] std::uint64_t received() const override { return decoder_.counters().bytes; }
  [[nodiscard]] std::optional<Stamp> toHost(Stamp device) const override;
  bool nextRemark(DeviceFault& remark) override;
  [[nodiscard]] std::string stream() const override;
  [[nodiscard]] nlohmann::ordered_json counters() const override;

 private:
  [[nodiscard]] bool isMavlink() const { return decoder_.protocol() == ImuProtocol::kMavlink; }
  /// Result of a write to the port. Only a lost port ends the link.
  DeviceFault judge(const DeviceFault& fault);
  DeviceFault close(const DeviceFault& fault);
  void pauseInFlood(Stamp read_at);

  LinkPort port_;
  ImuDecoder decoder_;
  AutopilotDialogue dialogue_;
  SensorSetup setup_;
  LinkOutbox* outbox_;
  std::array<std::uint8_t, ImuDecoder::kMostFed> bytes_;
  Stamp window_;  ///< start of the interval in which datagrams are counted
  int datagrams_ = 0;
  std::uint64_t sent_ = 0, refused_ = 0;  ///< outbox messages sent; writes refused for lack of room
};

}  // namespace swiftlet
