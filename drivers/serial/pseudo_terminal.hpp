#pragma once
// The other end of a serial port made of nothing: for tests and for replay into an unmodified program.
//
// What is sent here comes out of the port at path(), and the other way round. hangUp() is the plug pulled.
// The kernel holds some 4 kB that nobody read; more is refused, so that a replay sees its reader fall back.

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
  /// Bytes that were sent and that nobody has read.
  [[nodiscard]] std::size_t unread() const;

 private:
  int descriptor_ = -1;
  // Held open, or the first reader that closes the port would look like the plug pulled.
  int other_end_ = -1;
  std::string path_;
};

}  // namespace swiftlet
