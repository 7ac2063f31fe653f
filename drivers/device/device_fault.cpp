#include "drivers/device/device_fault.hpp"

#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <system_error>

namespace swiftlet {
namespace {

struct Words {
  const char* what;
  const char* remedy;
};

Words words(DeviceFaultKind kind) {
  switch (kind) {
    case DeviceFaultKind::kNone:
      return {"no fault", ""};
    case DeviceFaultKind::kMissing:
      return {"not there", "connect it, or correct its name in the vehicle settings"};
    case DeviceFaultKind::kNoRights:
      return {"no permission to open it",
              "join the group that owns it (`ls -l` on its node shows it), then log in again"};
    case DeviceFaultKind::kBusy:
      return {"held by another program", "close that program: `fuser -v` on its node names it"};
    case DeviceFaultKind::kWrongDevice:
      return {"not the kind of device that the settings expect", "correct its name in the vehicle settings"};
    case DeviceFaultKind::kUnsupported:
      return {"does not support the requested setting", "request a supported value"};
    case DeviceFaultKind::kChanged:
      return {"changed a requested setting", "use a supported value in the vehicle settings"};
    case DeviceFaultKind::kDown:
      return {"down", "bring it up"};
    case DeviceFaultKind::kUnplugged:
      return {"gone", "connect it again: it is reopened automatically"};
    case DeviceFaultKind::kSilent:
      return {"sends nothing", "check its power, its wires and that its output is enabled"};
    case DeviceFaultKind::kGarbage:
      return {"sends unexpected data", "check the baud rate and the protocol in the vehicle settings"};
    case DeviceFaultKind::kFailed:
      return {"failed", "unplug it and plug it in again; the kernel log (`dmesg`) may show the reason"};
    case DeviceFaultKind::kLossy:
      return {"loses data", "check its cable, and the load of its bus and of this computer"};
    case DeviceFaultKind::kNoisy:
      return {"sends too much", "check the wire's ground, shield and pull resistor"};
    case DeviceFaultKind::kClockJumped:
      return {"its clock jumped", "check its power supply: a restart of the sensor causes this"};
    case DeviceFaultKind::kWrongClock:
      return {"its stamps come from another clock",
              "synchronize the clock of the stamping computer by NTP or PTP; `swiftlet replay` reads bags"};
    case DeviceFaultKind::kClockSet:
      return {"the wall clock of its stamps was set", "let NTP set it before the flight"};
    case DeviceFaultKind::kDark:
      return {"sees nothing", "check the lens cap, the light, exposure and gain"};
    case DeviceFaultKind::kFrozen:
      return {"repeats one image", "unplug it and plug it in again"};
    case DeviceFaultKind::kUnmatched:
      return {"its frames match no trigger edges",
              "check the trigger's wire, trigger.line, trigger.delay_us and cameras.exposure_ms"};
    case DeviceFaultKind::kMatched:
      return {"its frames match the trigger edges again", ""};
  }
  return {"unknown fault", ""};
}

}  // namespace

DeviceFault deviceFault(DeviceFaultKind kind, int error, const char* format, ...) {
  DeviceFault fault;
  fault.kind = kind;
  fault.error = error;
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(fault.detail.data(), fault.detail.size(), format, arguments);
  va_end(arguments);
  return fault;
}

DeviceFault openFault(int error, std::string_view what) {
  DeviceFaultKind kind = DeviceFaultKind::kFailed;
  if (error == ENOENT || error == ENXIO || error == ENODEV) kind = DeviceFaultKind::kMissing;
  if (error == EACCES || error == EPERM) kind = DeviceFaultKind::kNoRights;
  if (error == EBUSY) kind = DeviceFaultKind::kBusy;
  return deviceFault(kind, error, "%.*s", static_cast<int>(what.size()), what.data());
}

std::string describe(const DeviceFault& fault, std::string_view device) {
  const Words said = words(fault.kind);
  std::string text = std::string(device) + ": " + said.what;
  if (!fault.text().empty()) text += " (" + std::string(fault.text()) + ")";
  if (fault.error != 0) text += ": " + std::generic_category().message(fault.error);
  if (said.remedy[0] != '\0') text += std::string("; ") + said.remedy;
  return text;
}

}  // namespace swiftlet
