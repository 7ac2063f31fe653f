#pragma once
// Reads the edges of one GPIO line with the kernel's stamps, in CLOCK_MONOTONIC.
//
// It uses the kernel's v2 line events, which are numbered per line, so lost events are detected. On kernels
// before 5.10, which do not have them, it uses libgpiod 1.6 if it was present at build time: lost events are
// then detected only by a gap in time, and only if the period is known.
//
// open() allocates and may be called again after any fault, for instance when a removed chip is back. read()
// does not wait, allocate or throw. The kernel keeps `buffer` events for a slow reader and then drops the
// oldest (libgpiod: keeps 16 and drops the newest). Memory: 200 bytes; read(): one system call per 16 events.
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
  std::string chip;  ///< path, name or label; see GpioChip::open
  std::string line;  ///< offset or name
  EdgeKind edges = EdgeKind::kRising;
  Duration period = {};        ///< between edges of the selected kind; zero: unknown
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
  /// For poll(): readable when edges wait, error or hang-up when the chip was removed. -1 when closed.
  [[nodiscard]] int fd() const { return fd_; }
  /// kKernel or kLibgpiod, once open.
  [[nodiscard]] EdgeInterface interface() const { return interface_; }

  /// Takes waiting edges, at most `out.size()`; `count` can be 0. After a fault, reopen with open().
  DeviceFault read(std::span<EdgeEvent> out, std::size_t& count);

  /// Since the first open().
  [[nodiscard]] std::uint64_t edges() const { return edges_; }
  [[nodiscard]] std::uint64_t missed() const { return missed_; }

  /// Whether libgpiod was present at build time.
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
  gpiod_chip* chip_ = nullptr;  ///< handle of libgpiod
  gpiod_line* line_ = nullptr;
  EdgeGaps gaps_;
  std::uint64_t edges_ = 0;
  std::uint64_t missed_ = 0;
};

}  // namespace swiftlet
