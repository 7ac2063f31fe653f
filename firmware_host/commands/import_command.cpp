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
      throw InputError("--first-image", 0, "", "`" + options.first + "` is not a timestamp",
                       "Give nanoseconds, or seconds with a decimal point");
    }
    request.first = first;
  }
  const ImportResult result = importVideo(request);
  for (const std::string& line : result.warnings) warn("warning: " + line + "\n");
  if (result.damaged > 0) warn(fmt::format("warning: {} damaged images omitted\n", result.damaged));
  say(fmt::format("{} images of {} camera{} over {:.1f} s, {} samples at {:.1f} Hz\nwritten to {}\n",
                  result.images, result.cameras, result.cameras == 1 ? "" : "s", result.seconds,
                  result.samples, result.imu_hz, request.out));
  if (request.calibration.empty()) {
    say("no calibration included: give one to `swiftlet replay` with --calibration\n");
  }
  return kExitDone;
}

}  // namespace

void addImportCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("import", "Convert a video and its IMU samples to a log");
  auto options = std::make_shared<ImportOptions>();
  ImportRequest& request = options->request;
  request.out = "log";
  command
      ->add_option("VIDEO", request.video, "Video file, or folder of a phone log (data.jsonl and data.mp4)")
      ->required();
  command->add_option("IMU", request.imu,
                      "IMU samples as csv with EuRoC's columns. Default: the samples inside a GoPro file");
  command->add_option("--out", request.out, "EuRoC/ASL folder to write")->capture_default_str();
  command
      ->add_option("--calibration", options->calibration,
                   "Calibration to write into the log: a folder, or Kalibr camchain and IMU files")
      ->expected(1, 2);
  command->add_option(
      "--first-image", options->first,
      "Time of the first image on the IMU's clock: ns, or s with a decimal point. Default: 1.0");
  command->footer(
      "Example:\n"
      "  swiftlet import karma.mp4 --calibration karma --out karma_log\n"
      "  swiftlet import video.mp4 imu.csv --first-image 0.0 --out log\n"
      "  swiftlet replay karma_log --mono");
  command->callback([options, &exit_code] { exit_code = import(*options); });
}

}  // namespace swiftlet
