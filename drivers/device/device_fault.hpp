#pragma once
// A device's fault as a value: drivers run on the flight path and do not throw. A copy costs 200 bytes; only
// describe() allocates.

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace swiftlet {

enum class DeviceFaultKind : std::uint8_t {
  kNone,
  kMissing,      ///< no such node, interface or line
  kNoRights,     ///< it exists, but this user may not open it
  kBusy,         ///< another program holds it
  kWrongDevice,  ///< it exists but is not the kind of device that the settings expect
  kUnsupported,  ///< it does not support what the settings request
  kChanged,      ///< it changed a requested setting
  kDown,         ///< the network interface is not up, or the bus is off
  kUnplugged,    ///< it was present and has disappeared
  kSilent,       ///< it is open but sends nothing
  kGarbage,      ///< it sends data that do not match the protocol
  kFailed,       ///< the kernel refused a call: see `error`
  kLossy,        ///< it works, but part of its data is lost
  kNoisy,        ///< it sends more than it should
  kClockJumped,  ///< its clock jumped
  kDark,         ///< the camera's image is dark
  kWrongClock,   ///< its stamps are from a clock other than this computer's
  kClockSet,     ///< this computer's wall clock, used for its stamps, was set
  kFrozen,       ///< the camera sends the same image again and again
  kUnmatched,    ///< the camera's frames match no trigger edges
  kMatched,      ///< end of kUnmatched
};

struct DeviceFault {
  DeviceFaultKind kind = DeviceFaultKind::kNone;
  int error = 0;                      ///< errno if a system call failed
  std::array<char, 184> detail = {};  ///< what was requested and what the device offers; null-terminated

  [[nodiscard]] bool ok() const { return kind == DeviceFaultKind::kNone; }
  [[nodiscard]] std::string_view text() const { return detail.data(); }
};

/// `format` as for printf; text that does not fit is cut.
[[gnu::format(printf, 3, 4)]] DeviceFault deviceFault(DeviceFaultKind kind, int error, const char* format,
                                                      ...);
/// Fault of a failed open(): missing, no rights, busy, or the kernel's error text.
DeviceFault openFault(int error, std::string_view what);

/// One line with the remedy, such as "camera 0 (/dev/video0): no such device: plug it in, or name ...".
/// `device` is the user's name for it. Allocates.
std::string describe(const DeviceFault& fault, std::string_view device);

}  // namespace swiftlet
