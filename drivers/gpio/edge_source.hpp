#pragma once
// The edges of one GPIO line with the kernel's stamps, in CLOCK_MONOTONIC.
//
// Through the kernel's v2 line events, which number the events of a line, so that a lost one is seen; or,
// where the kernel has none of these (before 5.10), through libgpiod 1.6, when it was there at build time:
// there only a gap in time shows the loss, and only when the period is known.
//
// open() allocates and may be called again after any fault, for the chip that was pulled out and came back;
// read() does not wait, allocate or throw. The kernel keeps `buffer` events for a reader that is late; then
// it drops the oldest (libgpiod: 16, the newest). Memory: 200 bytes; read(): one system call for 16 events.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "drivers/device/device_fault.hpp"
#include "drivers/gpio/edge_event.hpp"

struct gpiod_chip;
struct gpiod_line;

namespace swiftlet {

enum class EdgeInterface : std::uint8_t { kAny, kKernel, kLibgpiod };

struct EdgeSourceSettings {
  std::string chip;  ///< path, name or label: GpioChip::open
  std::string line;  ///< offset or name
  EdgeKind edges = EdgeKind::kRising;
  Duration period = {};        ///< between edges of that kind; zero: not known
  std::uint32_t buffer = 256;  ///< events: 12 s at 20 Hz
  EdgeInterface interface = EdgeInterface::kAny;
};

class EdgeSource {
 public:
  EdgeSource() = default;
  ~EdgeSource() { close(); }
  EdgeSource(const EdgeSource&) = delete;
  EdgeSource& operator=(const EdgeSource&) = delete;

  DeviceFault open(const EdgeSourceSettings& settings);
  void close();
  [[nodiscard]] bool isOpen() const { return fd_ >= 0; }
  /// For poll(): readable when edges wait, in error or hung up when the chip went. -1 when closed.
  [[nodiscard]] int fd() const { return fd_; }
  /// kKernel or kLibgpiod, once open.
  [[nodiscard]] EdgeInterface interface() const { return interface_; }

  /// Takes waiting edges, at most `out.size()`; `count` may be 0. After a fault, reopen with open().
  DeviceFault read(std::span<EdgeEvent> out, std::size_t& count);

  /// Since the first open().
  [[nodiscard]] std::uint64_t edges() const { return edges_; }
  [[nodiscard]] std::uint64_t missed() const { return missed_; }

  /// Whether libgpiod was there when this was built.
  static bool hasLibgpiod();

 private:
  DeviceFault openKernel(int chip, std::uint32_t offset, const EdgeSourceSettings& settings);
  DeviceFault openLibgpiod(const std::string& path, std::uint32_t offset, EdgeKind edges);
  DeviceFault readKernel(std::span<EdgeEvent> out, std::size_t& count);
  DeviceFault readLibgpiod(std::span<EdgeEvent> out, std::size_t& count);
  void closeLibgpiod();
  [[nodiscard]] DeviceFault gone() const;

  int fd_ = -1;
  EdgeInterface interface_ = EdgeInterface::kAny;
  gpiod_chip* chip_ = nullptr;  ///< of libgpiod
  gpiod_line* line_ = nullptr;
  EdgeGaps gaps_;
  std::uint64_t edges_ = 0;
  std::uint64_t missed_ = 0;
};

}  // namespace swiftlet
