#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/log_options.hpp"
#include "firmware_host/commands/stop_signal.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/runs/doctor_run.hpp"

namespace swiftlet {
namespace {

struct DoctorOptions {
  DoctorRequest request;
  LogRequest log;
  LogCommandOptions of_log;
  SettingsOptions settings;
};

int doctorOfLog(const DoctorOptions& options) {
  LogRequest request = options.log;
  options.of_log.fill(request);
  const MachineReport report = examineLog(request, options.settings.read());
  say(report.text(request.log));
  if (request.stopped()) {
    warn("stopped early; the log was not checked to its end\n");
    return kExitFailed;
  }
  const bool good = std::ranges::none_of(
      report.lines, [](const MachineLine& line) { return line.verdict == MachineVerdict::kPoor; });
  return good ? kExitDone : kExitFailed;
}

int doctor(const DoctorOptions& options) {
  if (!options.log.log.empty()) return doctorOfLog(options);
  DoctorRequest request = options.request;
  request.stop = &stopOnSignal();
  const DoctorReport report = examine(request, options.settings.read());
  fmt::print("{}\n{}", report.computer.text("this computer"), report.connected.text("connected"));
  if (!report.vehicle.lines.empty()) fmt::print("\n{}", report.vehicle.text("this vehicle"));
  fmt::print("\nnext\n");
  for (const std::string& step : report.next) fmt::print("  {}\n", step);
  return report.ready() ? kExitDone : kExitFailed;
}

}  // namespace

void addDoctorCommand(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("doctor", "Check this computer, the connected devices and the vehicle's settings");
  auto options = std::make_shared<DoctorOptions>();
  command->add_option("--seconds", options->request.seconds, "Seconds to watch the vehicle's devices")
      ->check(nonNegative())
      ->capture_default_str();
  command->add_option("LOG", options->log.log, "Recorded log to check instead of this computer");
  options->of_log.addCalibration(*command);
  options->of_log.addSection(*command, options->log);
  command->add_flag("--mono", options->log.mono, "With LOG: use camera 0 only");
  options->settings.addTo(*command);
  command->footer(
      "Example:\n"
      "  swiftlet doctor\n"
      "  swiftlet doctor --settings vehicle.yaml\n"
      "  swiftlet doctor data/euroc_mh01_20s\n"
      "Exit code 0: the vehicle's devices work as configured, or no error was found in LOG.\n"
      "Exit code 1: something needs a remedy, or the settings name no device.");
  command->callback([options, &exit_code] { exit_code = doctor(*options); });
}

}  // namespace swiftlet
