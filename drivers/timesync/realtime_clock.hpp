#pragma once
// The thin part of RealtimeOffset: reads the clocks, and hears of steps from the kernel.

#include "drivers/device/device_fault.hpp"
#include "drivers/device/monotonic_now.hpp"
#include "drivers/timesync/realtime_offset.hpp"

namespace swiftlet {

/// Keeps a RealtimeOffset measured. open() once; update() with each batch of stamps: 0.2 us, and
/// about 2 us when a second has passed or the clock was set. Nothing allocated, nothing waits.
class RealtimeClock {
 public:
  RealtimeClock() = default;
  ~RealtimeClock() { close(); }
  RealtimeClock(const RealtimeClock&) = delete;
  RealtimeClock& operator=(const RealtimeClock&) = delete;

  /// A fault leaves the clock usable: steps are then found by the second only.
  DeviceFault open();
  void close();
  /// Readable (poll) when the real-time clock was set; -1 when not open.
  [[nodiscard]] int fd() const { return fd_; }

  /// Measures when due. Ok when the offset is usable.
  Status update();
  /// As RealtimeOffset's; a stamp that comes out after now had a step before it: measured anew, once.
  Status toMonotonic(Stamp real, Stamp& monotonic);
  [[nodiscard]] const RealtimeOffset& offset() const { return offset_; }

 private:
  [[nodiscard]] bool wasSet();
  DeviceFault arm();

  int fd_ = -1;
  RealtimeOffset offset_;
};

}  // namespace swiftlet
