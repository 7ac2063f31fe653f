#include <fmt/format.h>

#include <memory>

#include "drivers/calibration/calibration.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/outputs/run_folder/calibration_files.hpp"
#include "firmware_host/realtime/console.hpp"

namespace swiftlet {
namespace {

struct CalibrationCommand {
  std::vector<std::string> files;
  std::string out;
  SettingsOptions settings;
};

int showCalibration(const CalibrationCommand& options) {
  CalibrationOptions how;
  how.accept_unusual_rig = options.settings.read().calibration.accept_unusual_rig;
  const Calibration calibration =
      readCalibration(options.files[0], options.files.size() > 1 ? options.files[1] : std::string(), how);
  for (const std::string& line : calibration.warnings) warn("warning: " + line + "\n");
  fmt::print("{}", describe(calibration));
  if (options.out.empty()) return kExitDone;
  writeCalibration(options.out, calibration);
  fmt::print("written to {}: give the folder to --calibration or vehicle.calibration\n", options.out);
  return kExitDone;
}

}  // namespace

void addCalibrationCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand(
      "calibration", "Show a calibration of any format and convert it to EuRoC's and Kalibr's formats");
  auto options = std::make_shared<CalibrationCommand>();
  command
      ->add_option("files", options->files,
                   "A folder, or a file from EuRoC, Kalibr, Basalt, ROS camera_info or OpenCV, with the IMU "
                   "file if it is elsewhere")
      ->required()
      ->expected(1, 2);
  command->add_option("--out", options->out, "Folder for the calibration in EuRoC's and Kalibr's formats");
  options->settings.addTo(*command);
  command->footer(
      "Example:\n"
      "  swiftlet calibration basalt_calib.json --out rig\n"
      "  swiftlet calibration left_right_and_imu_yaml/\n"
      "Lens models that the estimator does not support are converted; the residual is shown in pixels.");
  command->callback([options, &exit_code] { exit_code = showCalibration(*options); });
}

}  // namespace swiftlet
