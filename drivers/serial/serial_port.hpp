#pragma once
// A serial port as raw bytes: any baud rate up to 4 Mbaud, no waiting in reads, faults as values.
//
// Opening sets raw mode, 8N1, no flow control, excludes other programs (TIOCEXCL), requests low latency if
// the driver supports it (FTDI chips otherwise hold bytes for 16 ms), and reads the baud rate back: an error
// above 2 % is refused. Bytes received before are discarded. Once a port has disappeared, calls give
// kUnplugged; reopen() opens it again. Use names in /dev/serial/by-id, not ttyUSBn, whose number changes when
// the device is plugged in again.
//
// read(), wait(), write() and writeSome() do not allocate or throw; open() and reopen() may sleep in the
// kernel. Pseudo-terminals (tests, replay) support everything except low latency and error counters. Source:
// termios(3), tty_ioctl(4), linux/serial.h.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "drivers/device/device_fault.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct SerialSettings {
  std::string path;
  unsigned baud = 921'600;
};

/// Counters of the kernel driver since the port was created; empty if it has none (USB CDC, pty).
struct SerialErrors {
  std::uint32_t overrun = 0;  ///< bytes lost in the chip
  std::uint32_t framing = 0;  ///< invalid stop bits: wrong baud rate, or noise
  std::uint32_t parity = 0;
  std::uint32_t buffer_overrun = 0;  ///< bytes lost in the kernel: not read in time
};

class SerialPort {
 public:
  static constexpr unsigned kHighestBaud = 4'000'000;

  explicit SerialPort(SerialSettings settings) : settings_(std::move(settings)) {}
  ~SerialPort() { close(); }
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;

  DeviceFault open();
  void close();

  /// Reads available bytes without waiting: `count` can be 0. `read_at`: CLOCK_MONOTONIC when the read
  /// returned.
  DeviceFault read(std::span<std::uint8_t> into, std::size_t& count, Stamp& read_at);
  /// Waits until bytes arrive, the port disappears (read() then reports it), or `most` has passed.
  DeviceFault wait(Duration most);
  /// Sends as much as fits without waiting: `taken` can be 0.
  DeviceFault writeSome(std::span<const std::uint8_t> bytes, std::size_t& taken);
  /// Sends all of `bytes`, waiting at most `most` for the port to take them.
  DeviceFault write(std::span<const std::uint8_t> bytes, Duration most);

  [[nodiscard]] bool isOpen() const { return descriptor_ >= 0; }
  [[nodiscard]] int descriptor() const { return descriptor_; }
  [[nodiscard]] const SerialSettings& settings() const { return settings_; }
  /// Actual baud rate, as read back.
  [[nodiscard]] unsigned baud() const { return baud_; }
  /// Time of one byte on the wire: ten bits. Zero for USB CDC and pseudo-terminals, which have no real baud
  /// rate.
  [[nodiscard]] Duration byteTime() const { return byte_time_; }
  [[nodiscard]] std::optional<SerialErrors> errors() const;

 private:
  DeviceFault configure();
  void askLowLatency() const;
  DeviceFault unplugged(int error);

  SerialSettings settings_;
  int descriptor_ = -1;
  unsigned baud_ = 0;
  Duration byte_time_;
};

}  // namespace swiftlet
