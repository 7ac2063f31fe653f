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
      return {"this user may not open it",
              "join the group that owns it (`ls -l` on its node says which), then log in again"};
    case DeviceFaultKind::kBusy:
      return {"held by another program", "end that program: `fuser -v` on its node names it"};
    case DeviceFaultKind::kWrongDevice:
      return {"not the device that the settings take it for", "correct its name in the vehicle settings"};
    case DeviceFaultKind::kUnsupported:
      return {"does not offer what is asked", "ask for something that it offers"};
    case DeviceFaultKind::kChanged:
      return {"made something else of a setting", "set what it can do in the vehicle settings"};
    case DeviceFaultKind::kDown:
      return {"down", "bring it up"};
    case DeviceFaultKind::kUnplugged:
      return {"gone", "connect it again: it is taken up by itself"};
    case DeviceFaultKind::kSilent:
      return {"sends nothing", "check its power, its wires and that its output is switched on"};
    case DeviceFaultKind::kGarbage:
      return {"sends something else", "check the baud rate and the protocol in the vehicle settings"};
    case DeviceFaultKind::kFailed:
      return {"failed", "unplug it and plug it in again; the kernel's log (`dmesg`) may say more"};
    case DeviceFaultKind::kLossy:
      return {"part of it is lost", "check its cable, and the load of its bus and of this computer"};
    case DeviceFaultKind::kNoisy:
      return {"sends too much", "check the wire's ground, shield and pull resistor"};
    case DeviceFaultKind::kClockJumped:
      return {"its clock jumped", "check its power supply: a sensor that restarts does this"};
    case DeviceFaultKind::kWrongClock:
      return {"its stamps are of another clock",
              "set the clock of the computer that stamps by NTP or PTP; `swiftlet replay` reads bags"};
    case DeviceFaultKind::kClockSet:
      return {"the wall clock, by which it stamps, was set", "let NTP set it before the flight"};
    case DeviceFaultKind::kDark:
      return {"sees nothing", "check the lens cap, the light, exposure and gain"};
    case DeviceFaultKind::kFrozen:
      return {"repeats one image", "unplug it and plug it in again"};
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
