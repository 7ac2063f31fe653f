#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/lab_commands.hpp"
#include "firmware_host/commands/stop_signal.hpp"
#include "firmware_host/commands/view_option.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/runs/record_run.hpp"

namespace swiftlet {
namespace {

struct RecordOptions {
  RecordRequest request;
  std::string mcap;
  std::string board;
  ViewOption view;
  SettingsOptions settings;
};

int record(const RecordOptions& options) {
  RecordRequest request = options.request;
  request.mcap = !options.mcap.empty();
  if (request.mcap) request.out = options.mcap;
  request.stop = &stopOnSignal();
  surviveHangUp();
  std::unique_ptr<RecordWatcher> guidance;
  if (!options.board.empty()) guidance = labGuidance(options.board, options.view.read());
  request.watcher = guidance.get();
  const RecordResult result = runRecord(request, options.settings.read());
  if (!result.missing.empty()) {
    for (const std::string& line : result.missing) warn("error: " + line + "\n");
    warn("nothing was recorded; `swiftlet doctor` checks all devices and this computer\n");
    return kExitFailed;
  }
  const RecordSink::Counters& written = result.written;
  std::string text = fmt::format("{} samples", written.samples);
  std::uint64_t lost = written.samples_lost;
  for (std::size_t c = 0; c < result.cameras; ++c) {
    text += fmt::format(", {} images of camera {}", written.images[c], c);
    lost += written.images_lost[c];
  }
  const auto images_end = written.images.begin() + static_cast<std::ptrdiff_t>(result.cameras);
  say(fmt::format("{}\nwritten to {}\n", text, request.out));
  if (written.samples == 0 || std::count(written.images.begin(), images_end, 0U) > 0) {
    warn(
        "error: a device delivered no data; `swiftlet doctor` with the same settings names it and the "
        "reason\n");
    return kExitFailed;
  }
  if (lost > 0) {
    warn(fmt::format("error: {} samples and {} images dropped: the disk is too slow for these cameras\n",
                     written.samples_lost, lost - written.samples_lost));
    return kExitFailed;
  }
  return kExitDone;
}

}  // namespace

void addRecordCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand(
      "record", "Record the vehicle's cameras and IMU as an EuRoC/ASL folder or an MCAP file");
  auto options = std::make_shared<RecordOptions>();
  RecordRequest& request = options->request;
  request.out = "recording";
  CLI::Option* folder = command->add_option("--out", request.out, "Folder to write")->capture_default_str();
  command->add_option("--mcap", options->mcap, "MCAP file to write instead, with ROS 2 messages")
      ->excludes(folder);
  command
      ->add_option("--seconds", request.seconds,
                   "Stop after this many seconds. Default: stop on SIGINT or SIGTERM")
      ->check(nonNegative());
  CLI::Option* calibrate =
      command->add_option("--calibrate", options->board,
                          "Guide a calibration recording in front of this board (Kalibr's target YAML): "
                          "prints what is missing and stops when it is complete");
  options->view.addTo(*command)->needs(calibrate);
  options->settings.addTo(*command);
  command->footer(
      "Examples: a plain recording for Kalibr or swiftlet replay, and a guided one:\n"
      "  swiftlet record --settings vehicle.yaml --seconds 60 --out calibration_1\n"
      "  swiftlet record --settings vehicle.yaml --out calibration_1 --calibrate board.yaml --view");
  command->callback([options, &exit_code] { exit_code = record(*options); });
}

}  // namespace swiftlet
