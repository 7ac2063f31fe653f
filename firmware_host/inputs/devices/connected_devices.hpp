#pragma once
// Lists devices connected to this computer that a vehicle could use: cameras, serial ports, CAN interfaces,
// GPIO chips.

#include <string>

#include "firmware_host/realtime/machine_report.hpp"

namespace swiftlet {

/// One line per device, or one line per kind if there is no device. `root` is the prefix of every path except
/// those of cameras. `try_formats`: requests an image in every format of every camera, which takes tens of
/// milliseconds per format, and a second for a camera that delivers none.
MachineReport connectedDevices(const std::string& root = "", bool try_formats = false);

}  // namespace swiftlet
