#pragma once
// Options of the commands that read a log: calibration and section.

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "firmware_host/inputs/log/log_request.hpp"

namespace swiftlet {

struct LogCommandOptions {
  std::vector<std::string> calibration;
  double until = -1;

  void addCalibration(CLI::App& command);
  void addSection(CLI::App& command, LogRequest& request);
  /// Copies the options, shows progress on stderr, and lets signals stop the run. InputError.
  void fill(LogRequest& request) const;
};

}  // namespace swiftlet
