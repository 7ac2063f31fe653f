#pragma once
// What is connected to this computer that a vehicle could use: cameras, serial ports, CAN interfaces, GPIO
// chips.

#include <string>

#include "firmware_host/realtime/machine_report.hpp"

namespace swiftlet {

/// One line per device, or one per kind without a device. `root` is the prefix of every path except the
/// cameras'. `try_formats`: every format of every camera is tried for an image, which takes tens of
/// milliseconds each, and a second for a camera that delivers none.
MachineReport connectedDevices(const std::string& root = "", bool try_formats = false);

}  // namespace swiftlet
