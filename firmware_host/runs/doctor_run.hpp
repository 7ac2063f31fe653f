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
  double seconds = 5;  ///< how long the vehicle's devices are observed
  const std::atomic<bool>* stop = nullptr;
};

struct DoctorReport {
  MachineReport computer;
  MachineReport connected;
  MachineReport vehicle;          ///< empty if the settings name no device
  std::vector<std::string> next;  ///< what to do next, in order; empty: ready to fly

  /// Whether no device of the vehicle is poor or missing. Poor lines of the computer cost latency but do not
  /// count.
  [[nodiscard]] bool ready() const;
};

DoctorReport examine(const DoctorRequest& request, const Settings& settings);

/// Inspects a minute of motion in a recorded log. Returns mistakes in units, axes, clocks and calibration as
/// poor lines, and the measured values. InputError if the log cannot be read.
MachineReport examineLog(const LogRequest& request, const Settings& settings);

}  // namespace swiftlet
