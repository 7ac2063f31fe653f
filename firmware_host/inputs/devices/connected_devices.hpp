#pragma once
// What is connected to this computer that a vehicle could use: cameras, serial ports, CAN interfaces, GPIO
// chips.

#include <string>

#include "firmware_host/realtime/machine_report.hpp"

namespace swiftlet {

/// A line for each device, or one for each kind of which there is none. `root` stands in front of every path
/// (but cameras', which must be asked).
MachineReport connectedDevices(const std::string& root = "");

}  // namespace swiftlet
