#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/parse_number.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/lab/import/import_run.hpp"
#include "firmware_host/realtime/console.hpp"

namespace swiftlet {
namespace {

struct ImportOptions {
  ImportRequest request;
  std::vector<std::string> calibration;
  std::string first;
};

int import(const ImportOptions& options) {
  ImportRequest request = options.request;
  if (!options.calibration.empty()) request.calibration = options.calibration[0];
  if (options.calibration.size() > 1) request.imu_calibration = options.calibration[1];
  if (!options.first.empty()) {
    Stamp first;
    if (!parseCsvStamp(options.first, first)) {
      throw InputError("--first-image", 0, "", "`" + options.first + "` is not a stamp",
                       "Give nanoseconds, or seconds with a decimal point");
    }
    request.first = first;
  }
  const ImportResult result = importVideo(request);
  for (const std::string& line : result.warnings) warn("warning: " + line + "\n");
  if (result.damaged > 0)
    warn(fmt::format("warning: {} pictures are damaged and left out\n", result.damaged));
  say(fmt::format("{} images of {} camera{} over {:.1f} s, {} samples at {:.1f} Hz\nwritten to {}\n",
                  result.images, result.cameras, result.cameras == 1 ? "" : "s", result.seconds,
                  result.samples, result.imu_hz, request.out));
  if (request.calibration.empty()) {
    say("no calibration is in it: give one to `swiftlet replay` with --calibration\n");
  }
  return kExitDone;
}

}  // namespace

void addImportCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("import", "Make a log of a video and its IMU");
  auto options = std::make_shared<ImportOptions>();
  ImportRequest& request = options->request;
  request.out = "log";
  command
      ->add_option("VIDEO", request.video,
                   "Video file, or the folder of a phone's log (data.jsonl and data.mp4)")
      ->required();
  command->add_option("IMU", request.imu,
                      "IMU samples, csv in EuRoC's columns; default: those in the file of a GoPro");
  command->add_option("--out", request.out, "Folder to write, EuRoC/ASL")->capture_default_str();
  command
      ->add_option("--calibration", options->calibration,
                   "Calibration to write into the log: a folder, or Kalibr camchain and IMU files")
      ->expected(1, 2);
  command->add_option(
      "--first-image", options->first,
      "Time of the first image on the clock of IMU: ns, or s with a decimal point; default: 1.0");
  command->footer(
      "Example:\n"
      "  swiftlet import karma.mp4 --calibration karma --out karma_log\n"
      "  swiftlet import video.mp4 imu.csv --first-image 0.0 --out log\n"
      "  swiftlet replay karma_log --mono");
  command->callback([options, &exit_code] { exit_code = import(*options); });
}

}  // namespace swiftlet
