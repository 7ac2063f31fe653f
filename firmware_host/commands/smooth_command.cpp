#include <fmt/format.h>

#include <memory>

#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/stop_signal.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/runs/smooth_run.hpp"

namespace swiftlet {
namespace {

struct SmoothOptions {
  SmoothRequest request;
  SettingsOptions settings;
};

int smooth(const SmoothOptions& options) {
  SmoothRequest request = options.request;
  request.stop = &stopOnSignal();
  request.announce = true;
  const FullSmoothing found = runSmooth(request, options.settings.read());
  if (!found.cut.empty()) {
    warn(fmt::format("warning: {}/keyframes.swk: {}; the keyframes before it are smoothed\n", request.run,
                     found.cut));
  }
  for (const auto& row : found.faults.rows()) warn(fmt::format("warning: {} ({})\n", row.text, row.count));
  if (found.poses.empty()) {
    warn(fmt::format("error: {}: {}; the folder is unchanged\n", request.run, found.problem));
    return kExitFailed;
  }
  say(fmt::format("{} keyframes, {} landmarks, {} of {} loops used, {} iterations in {:.1f} s\n",
                  found.report.keyframes, found.report.landmarks, found.report.revisits_used,
                  found.report.revisits, found.report.iterations, found.spent.wall));
  say(fmt::format("written to {}/map.tum\n", request.run));
  return kExitDone;
}

}  // namespace

void addSmoothCommand(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("smooth", "Smooth all keyframes of a finished run together: map.tum");
  auto options = std::make_shared<SmoothOptions>();
  command->add_option("RUN", options->request.run, "Run folder with keyframes.swk")->required();
  options->settings.addTo(*command);
  command->footer(
      "Example:\n  swiftlet smooth flights/000012_20261123T160412Z\n"
      "  swiftlet smooth run_mh01 --set smoother.full_memory_mib=8192");
  command->callback([options, &exit_code] { exit_code = smooth(*options); });
}

}  // namespace swiftlet
