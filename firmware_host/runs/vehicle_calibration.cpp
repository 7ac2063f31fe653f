#include "firmware_host/runs/vehicle_calibration.hpp"

#include <fmt/format.h>

#include <array>
#include <cstdio>

#include "drivers/input/input_error.hpp"
#include "estimator/core/units.hpp"
#include "firmware_host/inputs/devices/input_topics.hpp"
#include "firmware_host/inputs/devices/live_input.hpp"

namespace swiftlet {
namespace {

/// Focal length over image width assumed for an unknown lens, 80 degrees wide. It limits motion blur in
/// exposure control.
constexpr double kUnknownFocal = 0.6;

CameraModel unknownLens(const std::string& resolution) {
  std::array<int, 2> size{};
  char rest = 0;
  // NOLINTNEXTLINE(cert-err34-c): a number too large is a resolution that no camera has
  if (std::sscanf(resolution.c_str(), "%dx%d%c", &size[0], &size[1], &rest) != 2 || size[0] < 16 ||
      size[1] < 16 || size[0] > 16384 || size[1] > 16384) {
    throw InputError(
        "settings", 0, "cameras.resolution", "'" + resolution + "' is not an image size",
        "Give width and height in pixels, for example 752x480; `swiftlet doctor` lists what cameras offer");
  }
  const double focal = kUnknownFocal * size[0];
  return {CameraKind::kPinholeRadtan, size[0], size[1],
          Eigen::Vector4d(focal, focal, 0.5 * (size[0] - 1), 0.5 * (size[1] - 1)), Eigen::Vector4d::Zero()};
}

Calibration bareRig(const Settings& settings) {
  Calibration calibration;
  calibration.bare = true;
  calibration.form = "none";
  calibration.noise.rate_hz = settings.imu_link.rate_hz;
  Rig& rig = calibration.rig;
  rig.camera_count = namedCameras(settings);
  for (std::size_t c = 0; c < rig.camera_count; ++c) rig.camera[c] = unknownLens(settings.cameras.resolution);
  return calibration;
}

}  // namespace

Calibration vehicleCalibration(const Settings& settings) {
  if (settings.vehicle.calibration.empty()) {
    throw InputError("settings", 0, "vehicle.calibration", "no calibration is set",
                     "Set a folder with EuRoC's sensor.yaml files, or Kalibr's camchain. For a rig without "
                     "calibration see docs/guides/bare_rig_to_flight.md");
  }
  CalibrationOptions options;
  options.accept_unusual_rig = settings.calibration.accept_unusual_rig;
  Calibration calibration =
      readCalibration(settings.vehicle.calibration, settings.vehicle.imu_calibration, options);
  const CamerasGroup& cameras = settings.cameras;
  if (cameras.shutter == kRolling && !calibration.rig.rolls()) {
    if (cameras.readout_ms <= 0) {
      throw InputError("settings", 0, "cameras.readout_ms",
                       "the readout time of the rolling shutter is missing",
                       "Set the milliseconds from the first row to the last, here or in the calibration");
    }
    calibration.rig.readout = Duration::fromSeconds(cameras.readout_ms * kFromMs);
  }
  applyCameraInfo(settings, calibration);
  return calibration;
}

Calibration calibratedOrBareRig(const Settings& settings) {
  const bool bare = settings.vehicle.calibration.empty() && !settings.cameras.resolution.empty();
  return bare ? bareRig(settings) : vehicleCalibration(settings);
}

}  // namespace swiftlet
