#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/reported_run.hpp"
#include "firmware_host/commands/stop_signal.hpp"
#include "firmware_host/lab/playback/run_player.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/host_sleep.hpp"

namespace swiftlet {
namespace {

struct ViewOptions {
  std::string run;
  std::string address;
  std::string log;
  SettingsOptions settings;
};

int playRun(const ViewOptions& options) {
  const std::atomic<bool>& stop = stopOnSignal();
  ReportedRun run = readReportedRun(options.run, "", options.settings.read());
  auto moments = std::make_unique<RunMoments>(run.view.files, options.log);
  std::vector<MissingFile>& missing = run.view.files.missing;
  missing.insert(missing.end(), moments->missing().begin(), moments->missing().end());
  for (const MissingFile& one : missing) warn(fmt::format("note: {}: {}\n", one.file, one.what));
  const RunPlayer player(std::move(run), std::move(moments), parseViewAddress(options.address));
  say(fmt::format("view of {}: {}\nCtrl-C ends it\n", options.run, player.url()));
  constexpr Duration kLook = Duration::fromMilliseconds(100);
  while (!stop.load(std::memory_order_relaxed)) sleepFor(kLook);
  return kExitDone;
}

}  // namespace

void addViewCommand(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("view", "Play a finished run in the browser: images, 3D view and plots together");
  auto options = std::make_shared<ViewOptions>();
  command->add_option("RUN", options->run, "Run folder")->required();
  command->add_option("ADDRESS", options->address,
                      fmt::format("ADDRESS:PORT to serve the page at; default: {}. Port 0: any free port",
                                  ViewAddress{}.text()));
  command->add_option("--log", options->log,
                      "Log with the images; default: the run's own recording, or the log it was made from");
  options->settings.addTo(*command);
  command->footer(
      "Example:\n  swiftlet view run_mh01\n  swiftlet view run_mh01 127.0.0.1:8400 --log data/euroc_mh01");
  command->callback([options, &exit_code] { exit_code = playRun(*options); });
}

}  // namespace swiftlet
