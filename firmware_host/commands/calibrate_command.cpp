#include "firmware_host/commands/calibrate_commands.hpp"
#include "firmware_host/commands/command.hpp"

namespace swiftlet {

void addCalibrateCommand(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("calibrate", "Calibrate a new rig: print a board, then move the rig in front of it");
  command->require_subcommand(1);
  addCalibrateTarget(*command, exit_code);
  addCalibrateCameras(*command, exit_code);
  addCalibrateImuCamera(*command, exit_code);
  addCalibrateImuNoise(*command, exit_code);
  addCalibrateCheck(*command, exit_code);
}

}  // namespace swiftlet
