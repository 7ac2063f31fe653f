#pragma once
// The way to an autopilot as raw bytes: a serial port, or UDP datagrams. Nothing waits but wait().
//
// Named as the settings do: `/dev/ttyS1`, `udp:HOST:PORT`, or `udp:HOST:PORT@OWN_PORT` where the autopilot
// sends to a port that was agreed on. Datagrams of others than HOST are not read; without OWN_PORT, none of
// other ports of HOST than PORT either. The kernel drops them: they wake nobody. A serial port that goes
// away gives kUnplugged until reopen() finds it again; UDP knows no such thing, and what nobody takes is
// lost.

#include <netinet/in.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "drivers/device/device_fault.hpp"
#include "drivers/serial/serial_port.hpp"

namespace swiftlet {

/// Where datagrams go.
struct UdpAddress {
  std::string host;
  std::uint16_t port = 0;
  std::uint16_t own_port = 0;  ///< 0: any
};

/// Empty: `device` does not begin with "udp:". InputError naming autopilot.device for one that cannot be
/// read.
std::optional<UdpAddress> udpAddress(std::string_view device);

/// InputError where `device` is the IMU's too, by another name as well: who reads takes the other's bytes.
void checkOwnPort(const std::string& device, const std::string& imu_device);

class AutopilotPort {
 public:
  /// InputError as udpAddress().
  AutopilotPort(const std::string& device, unsigned baud);
  ~AutopilotPort() { close(); }
  AutopilotPort(const AutopilotPort&) = delete;
  AutopilotPort& operator=(const AutopilotPort&) = delete;

  /// Opens, or opens anew. Looks the host up, which may take seconds, the first time only.
  DeviceFault open();
  void close();

  /// Waits until bytes are there or `most` has passed.
  void wait(Duration most);
  /// What is there; `count` may be 0. Passes over a bounded number of others' datagrams.
  DeviceFault read(std::span<std::uint8_t> into, std::size_t& count, Stamp& read_at);
  /// All of `bytes`, or a fault: kUnplugged, or kFailed where there is no room, which passes.
  DeviceFault write(std::span<const std::uint8_t> bytes);

  /// Of UDP, once open: where answers come in.
  [[nodiscard]] std::uint16_t ownPort() const;
  [[nodiscard]] bool isUdp() const { return udp_.has_value(); }
  [[nodiscard]] Duration byteTime() const { return udp_ ? Duration{} : serial_.byteTime(); }

 private:
  DeviceFault openUdp();

  std::optional<UdpAddress> udp_;
  SerialPort serial_;
  sockaddr_in peer_ = {};
  bool peer_known_ = false;
  int socket_ = -1;
};

}  // namespace swiftlet
