#include "firmware_host/commands/board_log.hpp"

#include <fmt/format.h>

#include <atomic>

#include "drivers/target/target_file.hpp"
#include "firmware_host/commands/program.hpp"
#include "firmware_host/commands/stop_signal.hpp"
#include "firmware_host/files/output_guard.hpp"
#include "firmware_host/files/run_claim.hpp"
#include "firmware_host/realtime/console.hpp"

namespace swiftlet {

CLI::Option* BoardLogOptions::addTo(CLI::App& command, const std::string& log_help) {
  command.add_option("LOG", log.log, log_help)->required();
  command
      .add_option("--target", target, "Board description: YAML from `swiftlet calibrate target` or Kalibr")
      ->required();
  return command.add_flag("--mono", log.mono, "Use camera 0 only");
}

void BoardLogOptions::checkOut(const std::vector<std::string>& other_inputs) const {
  if (out.empty()) return;
  std::vector<std::string> inputs = other_inputs;
  inputs.push_back(log.log);
  inputs.push_back(target);
  refuseOutputInInput(out, inputs);
  for (const std::string& file : calibrationFilesIn(out)) refuseOutputInInput(file, inputs);
  refuseRunIn(out, RunKind::kCalibration);
}

std::optional<LogViews> searchBoard(BoardLogOptions& options) {
  options.log.target = readTarget(options.target);
  options.log.show_progress = true;
  const std::atomic<bool>& stop = stopOnSignal();
  options.log.stop = &stop;
  LogViews found = readLogViews(options.log);
  endOnSignal();
  if (stop.load()) {
    warn("stopped early; no calibration is written\n");
    return std::nullopt;
  }
  warnAll(found.warnings);
  for (std::size_t c = 0; c < found.camera_count; ++c) {
    fmt::print("camera {}: board found in {} of {} images\n", c, found.with_board[c], found.images[c]);
  }
  return found;
}

CameraSolution fitCameras(const BoardLogOptions& options, const LogViews& log, double told_baseline) {
  CameraInput input;
  input.target = options.log.target;
  input.views = log.views;
  input.camera_count = log.camera_count;
  input.image_size = log.image_size;
  input.told_baseline = told_baseline;
  return withProgress("fitting cameras",
                      [&](const auto& progress) { return calibrateCameras(input, progress); });
}

int refuseCalibration(const std::vector<std::string>& reasons) {
  for (const std::string& reason : reasons) warn("repeat: " + reason + "\n");
  warn("No calibration is written.\n");
  return kExitFailed;
}

}  // namespace swiftlet
