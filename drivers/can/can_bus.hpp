#pragma once
// One CAN interface through a raw SocketCAN socket: frames with the kernel's receive stamps, and the state
// and errors of the bus.
//
// Threads: one. Nothing blocks: poll fd() for POLLIN, then call next() until it gives no frame.
// Errors: values that name the remedy. kDown (interface down or bus off) ends by itself: keep calling next().
//   After kUnplugged or kMissing the socket is closed; reopen() opens the interface again once it exists.
// Stamps: the kernel's software stamp is in CLOCK_REALTIME. The offset to CLOCK_MONOTONIC is measured at each
//   receipt, so a step of the wall clock affects one frame at most. The best measurement since the last step
//   is used.
// Memory: the socket's buffer in the kernel; no allocation. Cost per frame: one system call and three clock
// readings. Source: the kernel's Documentation/networking/can.rst and timestamping.rst; linux/can/error.h.

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "drivers/can/can_frame.hpp"
#include "drivers/device/device_fault.hpp"
#include "drivers/device/host_clocks.hpp"

namespace swiftlet {

/// Accepts extended frames with (id & mask) == (this id & mask).
struct CanFilter {
  std::uint32_t id = 0;
  std::uint32_t mask = 0;
};

struct CanBusSettings {
  /// "can0". Room for more than the kernel's 15 characters, so that open() can refuse a longer name.
  std::array<char, 64> interface = {};
  bool fd = false;  ///< true: also FD frames; refused if the interface is set up for classic frames only
  std::array<CanFilter, 4> filters = {};
  std::size_t filter_count = 0;  ///< 0: every frame
  /// [bytes] Each frame is charged several hundred bytes; 4 MiB hold more than a second of a full bus.
  int receive_buffer = 4 << 20;

  void setInterface(const char* name);
  void addFilter(CanFilter filter);
  /// kMissing if the name is longer than any interface's.
  [[nodiscard]] DeviceFault nameFault() const;
};

struct CanBusCounters {
  std::uint64_t frames = 0;
  std::uint64_t fd_frames = 0;  ///< FD frames among them
  std::uint64_t sent = 0;
  std::uint64_t lost_in_socket = 0;  ///< dropped by the kernel because the socket buffer was full
  std::uint64_t error_frames = 0;
  std::uint64_t bus_off = 0;
  std::uint64_t restarts = 0;  ///< of the controller, after bus-off
  std::uint64_t controller_overflows = 0;
  std::uint64_t error_passive = 0;
  std::uint64_t went_down = 0;
  std::uint64_t without_stamp = 0;  ///< frames without a usable kernel stamp, stamped when read
  std::uint64_t reopened = 0;
};

class CanBus {
 public:
  CanBus() = default;
  CanBus(const CanBus&) = delete;
  CanBus& operator=(const CanBus&) = delete;
  ~CanBus() { close(); }

  DeviceFault open(const CanBusSettings& settings);
  DeviceFault reopen();
  void close();
  [[nodiscard]] bool isOpen() const { return fd_ >= 0; }
  [[nodiscard]] int fd() const { return fd_; }

  /// The oldest waiting frame; empty: none. Returns kDown, without a frame, while the interface is down or
  /// the bus is off. Handles up to 16 error frames per call.
  DeviceFault next(std::optional<CanFrame>& frame);
  /// kBusy: the interface's transmit queue is full; try again.
  DeviceFault send(const CanFrame& frame);

  [[nodiscard]] const CanBusCounters& counters() const { return counters_; }
  /// Maximum error of the newest frame's arrival, converted from the kernel's stamp.
  [[nodiscard]] Duration stampError() const { return clocks_ ? clocks_->error : Duration{}; }
  /// kChanged if the receive buffer is less than a quarter of the requested size because net.core.rmem_max is
  /// too low; the text says how to raise it.
  [[nodiscard]] const DeviceFault& warning() const { return warning_; }

 private:
  DeviceFault setUp();
  DeviceFault interfaceFault(int error) const;
  [[nodiscard]] bool interfaceIsUp() const;
  void takeError(std::uint32_t id, std::span<const std::uint8_t> data);
  [[nodiscard]] DeviceFault standing();

  int fd_ = -1;
  CanBusSettings settings_;
  CanBusCounters counters_;
  DeviceFault warning_;
  bool takes_fd_ = false;  ///< FD frames can be sent and received
  bool down_ = false;
  bool bus_off_ = false;
  std::uint32_t lost_seen_ = 0;
  std::optional<HostClocks> clocks_;
};

}  // namespace swiftlet
