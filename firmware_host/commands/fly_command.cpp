#include <fmt/format.h>

#include <memory>
#include <string>

#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/kept_map_options.hpp"
#include "firmware_host/commands/stop_signal.hpp"
#include "firmware_host/commands/verdict.hpp"
#include "firmware_host/commands/view_option.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/runs/fly_run.hpp"

namespace swiftlet {
namespace {

struct FlyOptions {
  FlyRequest request;
  SettingsOptions settings;
  ViewOption view;
};

int fly(const FlyOptions& options) {
  FlyRequest request = options.request;
  request.stop = &stopOnSignal();
  request.hung_up = &surviveHangUp();
  request.renew_stop = [] { return &stopOnSignal(); };
  request.show_progress = true;
  request.view = options.view.read();
  const FlyResult result = runFlight(request, options.settings.read());
  if (!result.missing.empty()) {
    for (const std::string& line : result.missing) warn("error: " + line + "\n");
    warn("no flight took place; `swiftlet doctor` checks all devices and this computer\n");
    return kExitFailed;
  }
  say(summaryText(result.summary));
  if (!result.out.empty()) say(fmt::format("written to {}\n", result.out));
  if (!result.lost.empty()) {
    warn(fmt::format("warning: files of this flight are missing or incomplete; the first one: {}\n",
                     result.lost));
  }
  if (!result.faultless) {
    warn("error: a thread of the flight failed; see executor.thread_faults in summary.json\n");
    return kExitFailed;
  }
  if (!result.has_pose) {
    const std::string events =
        result.out.empty() ? "" : "; " + result.out + "/events.log shows what the start waited for";
    warn(fmt::format("error: no pose during the whole flight{}\n", events));
    return kExitFailed;
  }
  return verdictOf(result.summary);
}

}  // namespace

void addFlyCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("fly", "Run the estimator live on the vehicle's cameras and IMU");
  auto options = std::make_shared<FlyOptions>();
  FlyRequest& request = options->request;
  command->add_option("--out", request.out,
                      "Run folder to write. Default: a new folder in flights.folder for each flight");
  command->add_flag("--replace", request.replace, "Replace the run in the folder of --out");
  command
      ->add_option("--seconds", request.seconds,
                   "Stop after this many seconds. Default: stop on SIGINT or SIGTERM")
      ->check(nonNegative());
  command->add_flag("--imu-rate", request.imu_rate, "Also write imu_rate.tum, the state at every IMU sample");
  command->add_flag("--loop-closure", request.loop_closure,
                    "Detect revisited places and correct drift in map.tum");
  addKeptMapOptions(*command, request.kept_maps);
  command->add_flag("--map", request.map, "Fuse depth into a labelled map: map.ply, map.glb");
  command->add_flag("--record", request.record,
                    "Record the estimator's inputs to recording/ in the run folder");
  options->view.addTo(*command);
  options->settings.addTo(*command);
  command->footer(
      "Example, with the vehicle's devices in a settings file (docs/connecting.md):\n"
      "  swiftlet doctor --settings vehicle.yaml\n"
      "  swiftlet fly --settings vehicle.yaml --record --out flight_1");
  command->callback([options, &exit_code] { exit_code = fly(*options); });
}

}  // namespace swiftlet
