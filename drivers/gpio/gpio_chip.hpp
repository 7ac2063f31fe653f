#pragma once
// GPIO chips and their lines by name, through the kernel's character devices. Not for the flight path: opens
// files and allocates.

#include <cstdint>
#include <string>

#include "drivers/device/device_fault.hpp"

namespace swiftlet {

struct GpioLine {
  std::uint32_t offset = 0;
  std::string name;      ///< often empty
  std::string consumer;  ///< name of the program that uses it; empty: free or unnamed
  bool used = false;
  bool output = false;
};

/// An open chip for queries; a line requested through it stays valid after the chip is closed.
class GpioChip {
 public:
  GpioChip() = default;
  ~GpioChip() { close(); }
  GpioChip(const GpioChip&) = delete;
  GpioChip& operator=(const GpioChip&) = delete;

  /// `which`: a path ("/dev/gpiochip0"), a name ("gpiochip0") or a label, as `swiftlet doctor` lists them.
  DeviceFault open(const std::string& which);
  void close();
  [[nodiscard]] int fd() const { return fd_; }
  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const std::string& label() const { return label_; }
  [[nodiscard]] std::uint32_t lines() const { return lines_; }

  DeviceFault line(std::uint32_t offset, GpioLine& out) const;
  /// `which`: an offset ("17") or a line's name.
  DeviceFault findLine(const std::string& which, GpioLine& out) const;

 private:
  DeviceFault openPath(const std::string& path);

  int fd_ = -1;
  std::string path_, name_, label_;
  std::uint32_t lines_ = 0;
};

}  // namespace swiftlet
