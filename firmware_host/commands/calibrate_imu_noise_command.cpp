#include <fmt/format.h>

#include <memory>
#include <string>

#include "firmware_host/commands/calibrate_commands.hpp"
#include "firmware_host/commands/program.hpp"
#include "firmware_host/files/output_guard.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/calibrate/imu_noise/imu_noise_run.hpp"
#include "firmware_host/lab/calibrate/page/solution_pages.hpp"
#include "firmware_host/realtime/console.hpp"

namespace swiftlet {
namespace {

struct ImuNoiseOptions {
  std::string log;
  std::string out;
};

int calibrateImuNoise(const ImuNoiseOptions& options) {
  const std::string page = options.out.empty() ? "" : fileBeside(options.out, ".html");
  for (const std::string& file : {options.out, page}) refuseOutputInInput(file, {options.log});
  const ImuNoiseResult result = measureImuNoise(options.log);
  warnAll(result.warnings);
  fmt::print("{}", imuNoiseText(result));
  if (!options.out.empty()) {
    writeWholeFile(options.out, imuNoiseYaml(result));
    writeCalibrationPage(page, imuNoisePage(result));
    fmt::print("written to {} and {}\n", options.out, page);
  }
  return kExitDone;
}

}  // namespace

void addCalibrateImuNoise(CLI::App& calibrate, int& exit_code) {
  CLI::App* command = calibrate.add_subcommand(
      "imu-noise", "Estimate the noise of an IMU from a log at rest (Allan deviation)");
  auto options = std::make_shared<ImuNoiseOptions>();
  command
      ->add_option("LOG", options->log,
                   "Log at rest, best for hours: a EuRoC folder (imu0 is enough), an imu0/data.csv, a bag or "
                   "a recording")
      ->required();
  command->add_option("--out", options->out,
                      "File for the result in the format of Kalibr's imu.yaml; a page with plots is written "
                      "beside it as .html");
  command->footer(
      "Example:\n"
      "  swiftlet calibrate imu-noise still --out imu.yaml\n"
      "Two hours at rest give the random walks of most sensors; ten minutes give the white noise.");
  command->callback([options, &exit_code] { exit_code = calibrateImuNoise(*options); });
}

}  // namespace swiftlet
