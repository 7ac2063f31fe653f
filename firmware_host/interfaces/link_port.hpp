#pragma once
// A link as raw bytes: a serial port or UDP datagrams. Only wait() blocks.
//
// Names are those of the settings: `/dev/ttyS1`, `udp:HOST:PORT`, or `udp:HOST:PORT@OWN_PORT` if the other
// side sends to an agreed port. Datagrams from other hosts are not read; without OWN_PORT, datagrams from
// other ports of HOST are not read either. The kernel drops them, so they wake no thread. With OWN_PORT,
// answers go to the port of the newest MAVLink datagram, before the first one to PORT. Writes are complete:
// bytes that a serial port has no room for are kept and sent first, and the next write is refused until they
// are sent, so frames are neither cut nor mixed. A serial port that disappears gives kUnplugged until open()
// finds it again. UDP cannot detect this: datagrams without a receiver are lost. Threads: one at a time.
// Memory: 2 kB inside the object, no allocation after open().

#include <netinet/in.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "drivers/device/device_fault.hpp"
#include "drivers/serial/serial_port.hpp"

namespace swiftlet {

/// Destination of datagrams.
struct UdpAddress {
  std::string host;
  std::uint16_t port = 0;
  std::uint16_t own_port = 0;  ///< 0: any
};

/// Empty if `device` does not start with "udp:". InputError naming `setting` if it is malformed.
std::optional<UdpAddress> udpAddress(std::string_view device, const char* setting);

/// Whether two settings name the same port: equal texts, or two names of one serial port.
bool samePort(const std::string& a, const std::string& b);

class LinkPort {
 public:
  /// The longest write.
  static constexpr std::size_t kMostWritten = 2048;

  /// Throws InputError like udpAddress().
  LinkPort(const std::string& device, unsigned baud, const char* setting = "autopilot.device");
  ~LinkPort() { close(); }
  LinkPort(const LinkPort&) = delete;
  LinkPort& operator=(const LinkPort&) = delete;

  /// Opens or reopens the port. The first call resolves the host name, which may take seconds.
  DeviceFault open();
  void close();
  [[nodiscard]] bool isOpen() const { return descriptor() >= 0; }
  /// Poll for reading; negative: closed.
  [[nodiscard]] int descriptor() const { return udp_ ? socket_ : serial_.descriptor(); }

  /// Waits until bytes have arrived or `most` has passed.
  void wait(Duration most);
  /// Reads what has arrived; `count` may be 0. Discards a bounded number of datagrams from other senders.
  DeviceFault read(std::span<std::uint8_t> into, std::size_t& count, Stamp& read_at);
  /// Accepts all of `bytes`, at most kMostWritten, or none: kUnplugged, or kFailed if there is no room.
  DeviceFault write(std::span<const std::uint8_t> bytes);
  /// Sends bytes kept from an earlier write. True: no bytes are left.
  bool flush();

  /// UDP, when open: the port on which answers arrive.
  [[nodiscard]] std::uint16_t ownPort() const;
  [[nodiscard]] bool isUdp() const { return udp_.has_value(); }
  [[nodiscard]] Duration byteTime() const { return udp_ ? Duration{} : serial_.byteTime(); }
  [[nodiscard]] std::optional<SerialErrors> errors() const { return udp_ ? std::nullopt : serial_.errors(); }

 private:
  DeviceFault openUdp();
  DeviceFault sendDatagram(std::span<const std::uint8_t> bytes);

  std::optional<UdpAddress> udp_;
  SerialPort serial_;
  sockaddr_in peer_ = {};
  bool peer_known_ = false;
  int socket_ = -1;
  // Bytes that the serial port has not accepted yet.
  std::array<std::uint8_t, kMostWritten> kept_;
  std::size_t kept_begin_ = 0, kept_end_ = 0;
};

}  // namespace swiftlet
