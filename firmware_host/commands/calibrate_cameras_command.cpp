#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>

#include "drivers/input/input_error.hpp"
#include "drivers/target/target_file.hpp"
#include "estimator/core/units.hpp"
#include "firmware_host/commands/calibrate_commands.hpp"
#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/program.hpp"
#include "firmware_host/commands/stop_signal.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/calibrate/board/log_views.hpp"
#include "firmware_host/lab/calibrate/cameras/calibrate_cameras.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_files.hpp"
#include "firmware_host/lab/calibrate/page/solution_pages.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/progress.hpp"

namespace swiftlet {
namespace {

struct CamerasOptions {
  LogViewsRequest log;
  std::string target;
  std::string out;
  double baseline_mm = 0;
};

int calibrateLogCameras(CamerasOptions options) {
  options.log.target = readTarget(options.target);
  options.log.show_progress = true;
  options.log.stop = &stopOnSignal();
  const LogViews log = readLogViews(options.log);
  warnAll(log.warnings);
  for (std::size_t c = 0; c < log.camera_count; ++c) {
    fmt::print("camera {}: board found in {} of {} images\n", c, log.with_board[c], log.images[c]);
  }
  CameraInput input;
  input.target = options.log.target;
  input.views = log.views;
  input.camera_count = log.camera_count;
  input.image_size = log.image_size;
  input.told_baseline = options.baseline_mm * 1e-3;
  constexpr int kParts = 100;
  Progress progress("fitting cameras", kParts);
  const CameraSolution solution = calibrateCameras(
      input, [&](double part) { progress.update(static_cast<std::uint64_t>(std::lround(part * kParts))); });
  progress.finish();
  fmt::print("{}", describe(solution));
  if (!options.out.empty()) {
    // Also written for a bad calibration, because the page shows the reason.
    std::filesystem::create_directories(options.out);
    const std::string page = (std::filesystem::path(options.out) / "report.html").string();
    writeCalibrationPage(page, cameraPage(solution, input.target, options.log.log));
    fmt::print("page written to {}\n", page);
  }
  if (!solution.reasons.empty()) {
    for (const std::string& reason : solution.reasons) warn("repeat: " + reason + "\n");
    warn("No calibration is written.\n");
    return kExitFailed;
  }
  if (options.out.empty()) return kExitDone;
  const std::string file = (std::filesystem::path(options.out) / "camchain.yaml").string();
  writeWholeFile(file, camchainYaml(solution));
  fmt::print("written to {}\n", file);
  return kExitDone;
}

}  // namespace

void addCalibrateCameras(CLI::App& calibrate, int& exit_code) {
  CLI::App* command = calibrate.add_subcommand(
      "cameras", "Calibrate the lenses of one or two cameras and their relative pose from images of a board");
  auto options = std::make_shared<CamerasOptions>();
  command
      ->add_option("LOG", options->log.log,
                   "Images of the board: a EuRoC folder (cam0 and cam1, IMU not needed; image names may be "
                   "numbers), an archive of one, a bag, or a recording. No calibration is needed")
      ->required();
  command
      ->add_option("--target", options->target,
                   "Board description: YAML from `swiftlet calibrate target` or Kalibr")
      ->required();
  command->add_option("--out", options->out,
                      "Folder for camchain.yaml in Kalibr's format and the page report.html");
  command
      ->add_option(
          "--baseline", options->baseline_mm,
          "Distance between the two lenses [mm], measured by hand: reveals a board of the wrong size")
      ->check(nonNegative());
  command->add_flag("--mono", options->log.mono, "Use camera 0 only");
  command->footer(
      "Example:\n"
      "  swiftlet calibrate cameras board_log --target board.yaml --out rig\n"
      "Show the board close, in every corner of both images, and tilted by 45 degrees to all sides. Exit "
      "code 1: the calibration is not good enough; the reasons are printed.");
  command->callback([options, &exit_code] { exit_code = calibrateLogCameras(*options); });
}

}  // namespace swiftlet
