#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>

#include "firmware_host/commands/calibrate_commands.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/log_options.hpp"
#include "firmware_host/lab/calibrate/check/check_run.hpp"
#include "firmware_host/lab/calibrate/page/solution_pages.hpp"
#include "firmware_host/realtime/console.hpp"

namespace swiftlet {
namespace {

struct CheckOptions {
  CheckRequest request;
  LogCommandOptions of_log;
  SettingsOptions settings;
};

int calibrateCheck(CheckOptions options) {
  options.of_log.fill(options.request);
  const CheckResult result = checkCalibration(options.request, options.settings.read());
  if (options.request.stopped()) {
    warn("stopped early; the calibration was not checked\n");
    return kExitFailed;
  }
  fmt::print("{}", checkText(result));
  if (!options.request.out.empty()) {
    const std::string page = (std::filesystem::path(options.request.out) / "report.html").string();
    writeCalibrationPage(page, checkPage(result));
    fmt::print("written to {}\n", page);
  }
  return result.verdict == CheckVerdict::kMoved ? kExitFailed : kExitDone;
}

}  // namespace

void addCalibrateCheck(CLI::App& calibrate, int& exit_code) {
  CLI::App* command = calibrate.add_subcommand(
      "check", "Check from a flight without a board whether a calibration still holds");
  auto options = std::make_shared<CheckOptions>();
  command
      ->add_option("LOG", options->request.log,
                   "Log of a flight with turns about all axes and changes of speed")
      ->required();
  options->of_log.addCalibration(*command);
  options->of_log.addSection(*command, options->request);
  command->add_flag("--mono", options->request.mono, "Use camera 0 only");
  command->add_option("--out", options->request.out, "Folder for the run and the page");
  options->settings.addTo(*command);
  command->footer(
      "Example:\n"
      "  swiftlet calibrate check data/euroc_mh01_20s --out check\n"
      "Exit code 0: the calibration holds, or the flight cannot decide it (the text says which); 1: the "
      "calibration has changed, or the check was stopped.");
  command->callback([options, &exit_code] { exit_code = calibrateCheck(*options); });
}

}  // namespace swiftlet
