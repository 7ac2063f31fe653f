#pragma once
// The other end of a virtual serial port, for tests and for replay into an unmodified program.
//
// Bytes sent here arrive at the port path(), and vice versa. hangUp() simulates unplugging. The kernel holds
// about 4 kB of unread bytes; more is refused, so a replay notices a slow reader.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "drivers/device/device_fault.hpp"

namespace swiftlet {

class PseudoTerminal {
 public:
  PseudoTerminal() = default;
  ~PseudoTerminal() { hangUp(); }
  PseudoTerminal(const PseudoTerminal&) = delete;
  PseudoTerminal& operator=(const PseudoTerminal&) = delete;

  /// Opens a new pair; after hangUp() the path is a new one.
  DeviceFault open();
  void hangUp();

  /// The path that a program opens as its serial port.
  [[nodiscard]] const std::string& path() const { return path_; }
  /// Sends without waiting; `taken`: bytes accepted.
  DeviceFault send(std::span<const std::uint8_t> bytes, std::size_t& taken);
  /// Reads what the program wrote, without waiting; `count` can be 0.
  DeviceFault receive(std::span<std::uint8_t> into, std::size_t& count);
  /// Bytes sent and not yet read.
  [[nodiscard]] std::size_t unread() const;

 private:
  int descriptor_ = -1;
  // Held open: otherwise a reader that closes the port would look like an unplugged device.
  int other_end_ = -1;
  std::string path_;
};

}  // namespace swiftlet
