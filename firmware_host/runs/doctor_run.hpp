#pragma once
// The report of `swiftlet doctor`: this computer, the connected devices, and the vehicle's own devices
// observed for some seconds. Every line that is not good gives a remedy.

#include <atomic>
#include <string>
#include <vector>

#include "firmware_host/inputs/log/log_request.hpp"
#include "firmware_host/realtime/machine_report.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

struct DoctorRequest {
  double seconds = 5;  ///< that the vehicle's devices are watched
  const std::atomic<bool>* stop = nullptr;
};

struct DoctorReport {
  MachineReport computer;
  MachineReport connected;
  MachineReport vehicle;          ///< empty if the settings name no device
  std::vector<std::string> next;  ///< what to do, in order; empty: fly

  /// Neither a device of the vehicle nor one that is missing for it is poor. The computer's own poor lines
  /// cost latency and do not count.
  [[nodiscard]] bool ready() const;
};

DoctorReport examine(const DoctorRequest& request, const Settings& settings);

/// Inspects a minute of motion of a recorded log: mistakes in units, axes, clocks and calibration as poor
/// lines, and the measured values. InputError if the log cannot be read.
MachineReport examineLog(const LogRequest& request, const Settings& settings);

}  // namespace swiftlet
