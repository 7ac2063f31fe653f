#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "drivers/input/input_error.hpp"
#include "firmware_host/commands/board_log.hpp"
#include "firmware_host/commands/calibrate_commands.hpp"
#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/program.hpp"
#include "firmware_host/files/run_claim.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_files.hpp"
#include "firmware_host/lab/calibrate/page/solution_pages.hpp"

namespace swiftlet {
namespace {

struct CamerasOptions : BoardLogOptions {
  double baseline_mm = 0;
};

int calibrateLogCameras(CamerasOptions options) {
  options.checkOut({});
  const std::optional<LogViews> log = searchBoard(options);
  if (!log) return kExitFailed;
  if (log->camera_count < 2 && options.baseline_mm > 0) {
    throw InputError("--baseline", 0, "", "is given, but the log has one camera", "Omit it");
  }
  const CameraSolution solution = fitCameras(options, *log, options.baseline_mm * 1e-3);
  fmt::print("{}", describe(solution));
  const CalibrationPage content = cameraPage(solution, options.log.target, options.log.log);
  std::optional<RunClaim> claim;
  if (!options.out.empty()) {
    // Also for a bad calibration: the page shows the reason, and no older calibration stays beside it.
    claim.emplace(options.out, RunKind::kCalibration, false);
    const std::string page = (std::filesystem::path(options.out) / "report.html").string();
    writeCalibrationPage(page, content);
    fmt::print("page written to {}\n", page);
  }
  if (!solution.reasons.empty()) return refuseCalibration(solution.reasons);
  fmt::print("{}\n", content.verdict_text);
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
  CLI::Option* mono =
      options->addTo(*command,
                     "Images of the board: a EuRoC folder (cam0 and cam1, IMU not needed; image names may be "
                     "numbers), an archive of one, a bag, or a recording. No calibration is needed");
  command->add_option("--out", options->out,
                      "Folder for camchain.yaml in Kalibr's format and the page report.html");
  command
      ->add_option(
          "--baseline", options->baseline_mm,
          "Distance between the two lenses [mm], measured by hand: reveals a board of the wrong size")
      ->check(nonNegative())
      ->excludes(mono);
  command->footer(
      "Example:\n"
      "  swiftlet calibrate cameras board_log --target board.yaml --out rig\n"
      "Show the board close, in every corner of both images, and tilted by 45 degrees to all sides. Exit "
      "code 1: the calibration is not good enough; the reasons are printed.");
  command->callback([options, &exit_code] { exit_code = calibrateLogCameras(*options); });
}

}  // namespace swiftlet
