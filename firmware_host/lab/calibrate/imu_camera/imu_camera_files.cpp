#include "firmware_host/lab/calibrate/imu_camera/imu_camera_files.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace swiftlet {

std::string describe(const ImuCameraSolution& solution) {
  if (solution.values.empty()) return {};
  std::string text = fmt::format("{:<26} {:>12} {:>10}\n", "value", "found", "1 sigma");
  for (const SolvedValue& value : solution.values) {
    text += fmt::format("{:<26} {:>12.5g} {:>10.2g} {}\n", value.name, value.value, value.sigma, value.unit);
  }
  const auto outliers = std::count_if(solution.corners.begin(), solution.corners.end(),
                                      [](const CornerResidual& corner) { return corner.outlier; });
  text += fmt::format(
      "corners {:.3f} px per axis, {} of {} rejected; gyro {:.2f} and accelerometer {:.2f} times their "
      "noise\n",
      solution.corner_sigma, outliers, solution.corners.size(), solution.gyro_sigma, solution.accel_sigma);
  return text;
}

Calibration calibrationOf(const ImuCameraSolution& solution, const ImuNoise& noise,
                          const std::array<double, kMaxCameras>& camera_rate_hz) {
  Calibration calibration;
  calibration.form = "swiftlet";
  calibration.rig = solution.rig;
  calibration.noise = noise;
  calibration.camera_rate_hz = camera_rate_hz;
  calibration.gyro_matrix = solution.gyro_matrix;
  calibration.accel_matrix = solution.accel_matrix;
  return calibration;
}

}  // namespace swiftlet
