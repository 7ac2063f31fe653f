#include "firmware_host/commands/log_options.hpp"

#include "drivers/input/input_error.hpp"
#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/stop_signal.hpp"

namespace swiftlet {

void LogCommandOptions::addCalibration(CLI::App& command) {
  command
      .add_option("--calibration", calibration,
                  "Calibration to use instead of the log's: a folder, or a file from Kalibr, Basalt, ROS or "
                  "OpenCV, with the IMU file if it is elsewhere")
      ->expected(1, 2);
}

void LogCommandOptions::addSection(CLI::App& command, LogRequest& request) {
  command.add_option("--from", request.from, "Start this many seconds after the first image")
      ->check(nonNegative());
  command.add_option("--until", until, "End this many seconds after the first image")->check(nonNegative());
}

void LogCommandOptions::fill(LogRequest& request) const {
  request.stop = &stopOnSignal();
  request.show_progress = true;
  if (until >= 0) request.until = until;
  if (!calibration.empty()) request.calibration = calibration[0];
  if (calibration.size() > 1) request.imu_calibration = calibration[1];
  if (request.until && *request.until < request.from) {
    throw InputError("--until", 0, "", "the section ends before it starts", "Set --until after --from");
  }
}

}  // namespace swiftlet
