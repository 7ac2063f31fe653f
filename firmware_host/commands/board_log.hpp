#pragma once
// What `calibrate cameras` and `calibrate imu-camera` share: the search for a board in a log, the fit of its
// cameras, and the folder of the result.

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "firmware_host/lab/calibrate/board/log_views.hpp"
#include "firmware_host/lab/calibrate/cameras/calibrate_cameras.hpp"
#include "firmware_host/realtime/progress.hpp"

namespace swiftlet {

struct BoardLogOptions {
  LogViewsRequest log;
  std::string target;
  std::string out;

  /// Adds LOG, --target and --mono. Returns the option --mono.
  CLI::Option* addTo(CLI::App& command, const std::string& log_help);
  /// Called before the search, which takes minutes. InputError if the result would overwrite the log, the
  /// board or one of the other files read, or files in `out` that no calibration wrote.
  void checkOut(const std::vector<std::string>& other_inputs) const;
};

/// Reads the board, searches the log's images and prints where the board was found. Empty if the user stopped
/// the search, which is reported: part of a log gives no calibration. Afterwards a signal ends the program.
[[nodiscard]] std::optional<LogViews> searchBoard(BoardLogOptions& options);

/// With a progress bar. `told_baseline`: m; 0: not measured.
[[nodiscard]] CameraSolution fitCameras(const BoardLogOptions& options, const LogViews& log,
                                        double told_baseline);

/// Runs `work` with a progress bar and returns its result. `work` takes a function of the share done, 0 to 1.
template <typename Work>
auto withProgress(const std::string& what, const Work& work) {
  constexpr int kParts = 100;
  Progress progress(what, kParts);
  auto result =
      work([&](double share) { progress.update(static_cast<std::uint64_t>(std::lround(share * kParts))); });
  progress.finish();
  return result;
}

/// Prints why there is no calibration. Returns the exit code.
int refuseCalibration(const std::vector<std::string>& reasons);

}  // namespace swiftlet
