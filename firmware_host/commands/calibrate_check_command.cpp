#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>

#include "firmware_host/commands/calibrate_commands.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/log_options.hpp"
#include "firmware_host/lab/calibrate/check/check_run.hpp"
#include "firmware_host/lab/calibrate/page/solution_pages.hpp"

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
  CLI::App* command =
      calibrate.add_subcommand("check", "Does a calibration still hold? From a flight without a board");
  auto options = std::make_shared<CheckOptions>();
  command->add_option("LOG", options->request.log, "A flight with turns about all axes and changes of speed")
      ->required();
  options->of_log.addCalibration(*command);
  options->of_log.addSection(*command, options->request);
  command->add_flag("--mono", options->request.mono, "Camera 0 alone");
  command->add_option("--out", options->request.out, "Folder to keep the run and the page in");
  options->settings.addTo(*command);
  command->footer(
      "Example:\n  swiftlet calibrate check data/euroc_mh01_20s --out check\n"
      "Exit code 0: it holds, or the flight cannot tell, which the text says; 1: it has moved.");
  command->callback([options, &exit_code] { exit_code = calibrateCheck(*options); });
}

}  // namespace swiftlet
