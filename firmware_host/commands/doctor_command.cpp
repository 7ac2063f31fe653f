#include <fmt/format.h>

#include <memory>

#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/stop_signal.hpp"
#include "firmware_host/runs/doctor_run.hpp"

namespace swiftlet {
namespace {

struct DoctorOptions {
  DoctorRequest request;
  SettingsOptions settings;
};

int doctor(const DoctorOptions& options) {
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
      app.add_subcommand("doctor", "Look at this computer, the connected devices and the vehicle's settings");
  auto options = std::make_shared<DoctorOptions>();
  command->add_option("--seconds", options->request.seconds, "Watch the vehicle's devices for so long")
      ->check(nonNegative())
      ->capture_default_str();
  options->settings.addTo(*command);
  command->footer(
      "Example:\n  swiftlet doctor\n  swiftlet doctor --settings vehicle.yaml\n"
      "Exit code 0: the vehicle's devices work as the settings want them.");
  command->callback([options, &exit_code] { exit_code = doctor(*options); });
}

}  // namespace swiftlet
