#pragma once
// What is wrong with a device, as a value: drivers run on the flight path and do not throw. Copying it costs
// 200 bytes; nothing allocates but describe().

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace swiftlet {

enum class DeviceFaultKind : std::uint8_t {
  kNone,
  kMissing,      ///< no such node, interface or line
  kNoRights,     ///< it is there and this user may not open it
  kBusy,         ///< another program holds it
  kWrongDevice,  ///< it exists but is not the kind of device that the settings expect
  kUnsupported,  ///< it does not support what the settings request
  kChanged,      ///< it changed a requested setting
  kDown,         ///< a network interface that is not up, a bus that is off
  kUnplugged,    ///< it was there, and went
  kSilent,       ///< it is open and sends nothing
  kGarbage,      ///< it sends data that do not match the protocol
  kFailed,       ///< the kernel refused a call: see `error`
  kLossy,        ///< it works, but part of its data is lost
  kNoisy,        ///< it sends more than it should
  kClockJumped,  ///< its clock went on from another reading
  kDark,         ///< a camera that sees nothing
  kWrongClock,   ///< its stamps are of another clock than this computer's
  kClockSet,     ///< this computer's wall clock was set, by which it stamps
  kFrozen,       ///< a camera that sends one image again and again
  kUnmatched,    ///< a camera whose frames match no trigger edges
  kMatched,      ///< the end of that
};

struct DeviceFault {
  DeviceFaultKind kind = DeviceFaultKind::kNone;
  int error = 0;                      ///< errno where a call failed
  std::array<char, 184> detail = {};  ///< what was requested, what the device offers; ends with 0

  [[nodiscard]] bool ok() const { return kind == DeviceFaultKind::kNone; }
  [[nodiscard]] std::string_view text() const { return detail.data(); }
};

/// `format` as of printf; what does not fit is cut.
[[gnu::format(printf, 3, 4)]] DeviceFault deviceFault(DeviceFaultKind kind, int error, const char* format,
                                                      ...);
/// Of a failed open(): missing, no rights, busy, or the kernel's own words.
DeviceFault openFault(int error, std::string_view what);

/// "camera 0 (/dev/video0): no such device: plug it in, or name ...". One line with the remedy; `device` as
/// the user knows it. Allocates.
std::string describe(const DeviceFault& fault, std::string_view device);

}  // namespace swiftlet
