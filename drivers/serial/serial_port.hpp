#pragma once
// A serial port as raw bytes: any baud rate up to 4 Mbaud, no waiting in reads, faults as values.
//
// Opening sets raw mode, 8N1, no flow control, locks other readers out (TIOCEXCL), asks for low latency
// where the driver can (FTDI chips hold bytes for 16 ms otherwise), and reads the baud rate back: more than
// 2 % off is refused. Bytes that waited from before are thrown away.
// A port that goes away gives kUnplugged from then on; reopen() takes it up again. Name it by
// /dev/serial/by-id, not by ttyUSBn: the number changes when it is plugged in again.
//
// read(), wait(), write() and writeSome() allocate nothing and do not throw; open() and reopen() may sleep in
// the kernel. Pseudo-terminals (tests, replay) take everything but low latency and the error counters.
// Source: termios(3), tty_ioctl(4), linux/serial.h.

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

/// Counters of the kernel's driver since the port was created; empty if it has none (USB CDC, pty).
struct SerialErrors {
  std::uint32_t overrun = 0;  ///< bytes that the chip lost
  std::uint32_t framing = 0;  ///< a stop bit that was none: wrong baud rate, or noise
  std::uint32_t parity = 0;
  std::uint32_t buffer_overrun = 0;  ///< bytes that the kernel lost: not read in time
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

  /// What is there, without waiting: `count` may be 0. `read_at`: CLOCK_MONOTONIC when the read returned.
  DeviceFault read(std::span<std::uint8_t> into, std::size_t& count, Stamp& read_at);
  /// Waits until bytes arrive, the port is gone (read() then reports it), or `most` has passed.
  DeviceFault wait(Duration most);
  /// Sends what there is room for, without waiting: `taken` may be 0.
  DeviceFault writeSome(std::span<const std::uint8_t> bytes, std::size_t& taken);
  /// Sends all of `bytes`, waiting at most `most` for the port to take them.
  DeviceFault write(std::span<const std::uint8_t> bytes, Duration most);

  [[nodiscard]] bool isOpen() const { return descriptor_ >= 0; }
  [[nodiscard]] int descriptor() const { return descriptor_; }
  [[nodiscard]] const SerialSettings& settings() const { return settings_; }
  /// What the port runs at, as read back.
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
