#include <fmt/format.h>

#include <memory>

#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/stop_signal.hpp"
#include "firmware_host/lab/hil/hil_run.hpp"
#include "firmware_host/realtime/console.hpp"

namespace swiftlet {
namespace {

struct HilOptions {
  HilRequest request;
  SettingsOptions settings;
  std::string faults;
};

int hil(const HilOptions& options) {
  HilRequest request = options.request;
  request.stop = &stopOnSignal();
  if (!options.faults.empty()) request.faults = FaultTimeline::read(options.faults);
  const HilResult result = runHil(request, options.settings.read());
  say(fmt::format("{}\nwritten to {}\n", result.report.dump(2), request.out));
  if (!result.complete) {
    warn("error: some messages were not played in time; see hil.json\n");
    return kExitFailed;
  }
  return kExitDone;
}

}  // namespace

void addHilCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand(
      "hil", "Play a recorded flight through the kernel's devices, which `swiftlet fly` reads like hardware");
  auto options = std::make_shared<HilOptions>();
  HilRequest& request = options->request;
  request.out = "hil";
  command
      ->add_option("LOG", request.log,
                   "EuRoC/ASL folder or an archive of one, a bag (rosbag2, MCAP, ROS 1), or a recorded run")
      ->required();
  command
      ->add_option("--out", request.out,
                   "Folder for truth.tum (on the host's clock), hil.json and faults.csv")
      ->capture_default_str();
  command->add_option("--faults", options->faults,
                      "Faults to inject: CSV lines of seconds,device,fault,for seconds[,value]");
  command
      ->add_option("--seconds", request.seconds, "Seconds of the log to play, from its first image; 0: all")
      ->check(nonNegative());
  command->add_option("--skew-ppm", request.skew_ppm, "Amount by which the IMU's clock runs fast [ppm]")
      ->check(CLI::Range(-1000.0, 1000.0))
      ->capture_default_str();
  command->add_option("--patience", request.patience, "Seconds to wait for a reader of the IMU")
      ->check(nonNegative())
      ->capture_default_str();
  command->add_option("--lead", request.lead, "Seconds from the reader's connection to the first image")
      ->check(nonNegative())
      ->capture_default_str();
  options->settings.addTo(*command);
  command->footer(
      "Example, in the kernel sandbox (docs/hil.md):\n"
      "  swiftlet hil data/euroc_mh01_20s --settings vehicle.yaml --faults faults.csv --out hil &\n"
      "  swiftlet fly --settings vehicle.yaml --seconds 25 --out flight\n"
      "  swiftlet evaluate flight --truth hil/truth.tum");
  command->callback([options, &exit_code] { exit_code = hil(*options); });
}

}  // namespace swiftlet
