#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/recorded/imu_file.hpp"
#include "firmware_host/commands/board_log.hpp"
#include "firmware_host/commands/calibrate_commands.hpp"
#include "firmware_host/commands/program.hpp"
#include "firmware_host/files/run_claim.hpp"
#include "firmware_host/lab/calibrate/imu_camera/calibrate_imu_camera.hpp"
#include "firmware_host/lab/calibrate/imu_camera/imu_camera_files.hpp"
#include "firmware_host/lab/calibrate/page/solution_pages.hpp"
#include "firmware_host/outputs/run_folder/calibration_files.hpp"

namespace swiftlet {
namespace {

struct ImuCameraOptions : BoardLogOptions {
  std::string cameras;
  std::string imu;
};

/// Initial lenses of the batch, read from a file.
CameraSolution camerasOf(const CameraChain& chain, const LogViews& log, const std::string& file) {
  CameraSolution solution;
  solution.camera_count = std::min(chain.rig.camera_count, log.camera_count);
  for (std::size_t c = 0; c < solution.camera_count; ++c) {
    const CameraModel& lens = chain.rig.camera[c];
    const Eigen::Vector2i& size = log.image_size[c];
    if (lens.width() != size.x() || lens.height() != size.y()) {
      throw InputError(file, 0, fmt::format("cam{}.resolution", c),
                       fmt::format("is for {}x{} pixels, but the log's images have {}x{}", lens.width(),
                                   lens.height(), size.x(), size.y()),
                       "Give the calibration of this image size, or omit --cameras");
    }
    solution.camera[c].model = lens;
  }
  if (solution.camera_count == 2) solution.T_cam1_cam0 = chain.rig.T_cam1_cam0();
  return solution;
}

bool hasLenses(const CameraSolution& cameras) {
  return cameras.camera_count > 0 && cameras.camera[0].model.width() > 0;
}

/// Adds the reasons of the camera step. Printed only: those that a rolling shutter explains, which that step
/// does not model, and those for which it found no lens where --cameras gave one.
void addReasonsOf(const CameraSolution& cameras, ImuCameraSolution& solution) {
  const bool replaced = !hasLenses(cameras) && solution.rig.camera_count > 0;
  for (const std::string& reason : cameras.reasons) {
    const std::vector<std::string>& rolling = cameras.rolling_reasons;
    const bool rolls = solution.rig.rolls() && std::ranges::find(rolling, reason) != rolling.end();
    if (rolls || replaced) {
      fmt::print("cameras alone{}: {}\n", rolls ? ", without rolling shutter" : "", reason);
    } else {
      solution.reasons.push_back(reason);
    }
  }
}

int calibrateLogImuCamera(ImuCameraOptions options) {
  options.checkOut({options.cameras, options.imu});
  ImuCameraInput input;
  // Errors in the files are reported before images are searched.
  std::optional<CameraChain> chain;
  if (!options.cameras.empty()) chain = readCameraChain(options.cameras);
  std::vector<std::string> left_out;
  if (!options.imu.empty()) input.noise = readImuNoise(options.imu, left_out);
  input.noise_told = !options.imu.empty();

  std::optional<LogViews> found = searchBoard(options);
  if (!found) return kExitFailed;
  LogViews& log = *found;
  if (log.samples.empty()) {
    throw InputError(options.log.log, 0, "", "has no IMU samples", "Record them with the images");
  }
  input.target = options.log.target;
  input.samples = std::move(log.samples);
  input.noise.rate_hz = medianRate(input.samples);
  if (chain) log.camera_count = std::min(log.camera_count, chain->rig.camera_count);
  // With --cameras too: the lenses are estimated again from this log, whose faults this step finds.
  const CameraSolution cameras = fitCameras(options, log, 0);
  input.cameras = chain ? camerasOf(*chain, log, options.cameras) : cameras;
  if (chain && chain->has_imu) input.told = chain->rig;
  std::array<double, kMaxCameras> rates{};
  for (std::size_t c = 0; c < log.camera_count; ++c) rates[c] = imageRate(log.views, c);
  input.views = std::move(log.views);
  const bool lenses = hasLenses(input.cameras);
  ImuCameraSolution solution;
  if (lenses) {
    solution = withProgress("fitting cameras and IMU",
                            [&](const auto& progress) { return calibrateImuCamera(input, progress); });
  }
  fmt::print("{}", describe(solution));
  addReasonsOf(cameras, solution);
  if (!input.noise_told) {
    fmt::print("noise: random walks of a typical MEMS IMU, densities from the residuals (no --imu given)\n");
    input.noise.gyro_density *= solution.gyro_sigma;
    input.noise.accel_density *= solution.accel_sigma;
  }
  for (const std::string& key : left_out) {
    fmt::print("{} is not in {}: a typical MEMS IMU's is assumed\n", key, options.imu);
  }
  // Also for a bad calibration: the page shows the reason, and no older calibration stays beside it.
  const RunClaim claim(options.out, RunKind::kCalibration, false);
  const CalibrationPage page = lenses ? imuCameraPage(solution, input.target, options.log.log)
                                      : cameraPage(cameras, input.target, options.log.log);
  writeCalibrationPage((std::filesystem::path(options.out) / "report.html").string(), page);
  if (!solution.reasons.empty()) return refuseCalibration(solution.reasons);
  writeCalibration(options.out, calibrationOf(solution, input.noise, rates),
                   "found by swiftlet calibrate imu-camera");
  fmt::print("{}\nwritten to {}\n", page.verdict_text, options.out);
  return kExitDone;
}

}  // namespace

void addCalibrateImuCamera(CLI::App& calibrate, int& exit_code) {
  CLI::App* command = calibrate.add_subcommand("imu-camera",
                                               "Calibrate cameras and IMU together: lenses, extrinsics, time "
                                               "offset, readout time, scale and misalignment");
  auto options = std::make_shared<ImuCameraOptions>();
  options->addTo(*command,
                 "Images of the board and IMU samples: a EuRoC folder or archive, a bag, or a recording. No "
                 "calibration is needed");
  command->add_option("--cameras", options->cameras,
                      "Kalibr camchain to start from, with or without an IMU. Default: the cameras are "
                      "calibrated from the log first");
  command->add_option("--imu", options->imu,
                      "Noise of the IMU: YAML from `swiftlet calibrate imu-noise`, Kalibr or EuRoC. Default: "
                      "a typical MEMS IMU");
  command->add_option("--out", options->out, "Folder for the calibration in EuRoC's and Kalibr's formats")
      ->required();
  command->footer(
      "Example:\n"
      "  swiftlet calibrate imu-camera board_log --target board.yaml --imu imu.yaml --out rig\n"
      "Move the rig in front of the board for a minute: rotate it about all three axes and swing it along "
      "all three, once or twice a second. Exit code 1: the calibration is not good enough; the reasons are "
      "printed.");
  command->callback([options, &exit_code] { exit_code = calibrateLogImuCamera(*options); });
}

}  // namespace swiftlet
