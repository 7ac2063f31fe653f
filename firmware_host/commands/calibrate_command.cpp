#include "firmware_host/commands/calibrate_commands.hpp"

#include <filesystem>

#include "drivers/input/input_error.hpp"
#include "firmware_host/commands/command.hpp"

namespace swiftlet {

void addCalibrateCommand(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("calibrate", "Calibrate a new rig: print a board, then move the rig in front of it");
  command->require_subcommand(1);
  command->footer(
      "Example:\n"
      "  swiftlet calibrate target --out board.pdf --paper A3\n"
      "  swiftlet record --settings vehicle.yaml --out board_log --calibrate board.yaml\n"
      "  swiftlet calibrate imu-camera board_log --target board.yaml --imu imu.yaml --out rig\n"
      "`swiftlet calibrate <command> --help` explains each command.");
  addCalibrateTarget(*command, exit_code);
  addCalibrateCameras(*command, exit_code);
  addCalibrateImuCamera(*command, exit_code);
  addCalibrateImuNoise(*command, exit_code);
  addCalibrateCheck(*command, exit_code);
}

std::string fileBeside(const std::string& out, const char* extension) {
  std::string beside = std::filesystem::path(out).replace_extension(extension).string();
  if (beside != out) return beside;
  throw InputError(out, 0, "--out", std::string("the file written beside it has the extension ") + extension,
                   "Give another extension");
}

}  // namespace swiftlet
