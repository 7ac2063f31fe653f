#pragma once
// The other end of a virtual serial port, for tests and for replay into an unmodified program.
//
// Bytes sent here arrive at the port at path(), and the other way round. hangUp() unplugs it. The kernel
// holds some 4 kB of unread bytes; more is refused, so a replay notices that its reader falls behind.

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

  /// A new pair of ends; after hangUp() again, with a new path.
  DeviceFault open();
  void hangUp();

  /// What a program opens as its serial port.
  [[nodiscard]] const std::string& path() const { return path_; }
  /// What the port took, without waiting.
  DeviceFault send(std::span<const std::uint8_t> bytes, std::size_t& taken);
  /// What the program wrote, without waiting; `count` may be 0.
  DeviceFault receive(std::span<std::uint8_t> into, std::size_t& count);
  /// Bytes sent and not yet read.
  [[nodiscard]] std::size_t unread() const;

 private:
  int descriptor_ = -1;
  // Held open, or the first reader that closes the port would look like the plug pulled.
  int other_end_ = -1;
  std::string path_;
};

}  // namespace swiftlet
