#pragma once
// What is connected to this computer that a vehicle could use: cameras, serial ports, CAN interfaces, GPIO
// chips.

#include <string>

#include "firmware_host/realtime/machine_report.hpp"

namespace swiftlet {

/// A line for each device, or one for each kind of which there is none. `root` stands in front of every path
/// but cameras'. `try_formats`: every format of every camera is tried for an image, which takes tens of
/// milliseconds each, and a second for a camera that gives none.
MachineReport connectedDevices(const std::string& root = "", bool try_formats = false);

}  // namespace swiftlet
