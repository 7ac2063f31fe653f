#include "firmware_host/outputs/run_folder/calibration_files.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <numbers>

#include "drivers/recorded/asl_text.hpp"
#include "firmware_host/files/whole_file.hpp"

namespace swiftlet {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr double kToMs = 1e3;

/// What of a camera was estimated, and how well.
std::string originText(const CalibrationEstimate& estimate, std::size_t camera) {
  std::string text = "estimated in flight;";
  if (estimate.rotation_sigma[camera] > 0) {
    text += fmt::format(" sigma of T_BS {:.4f} deg, {:.4f} m;", kDegrees * estimate.rotation_sigma[camera],
                        estimate.position_sigma[camera]);
  }
  if (estimate.shift_sigma > 0) {
    text += fmt::format(" sigma of timeshift_cam_imu {:.3f} ms;", kToMs * estimate.shift_sigma);
  }
  if (estimate.readout_sigma > 0) {
    text += fmt::format(" sigma of readout_ms {:.3f};", kToMs * estimate.readout_sigma);
  }
  text += " the rest as given";
  return text;
}

void writeSensor(const std::filesystem::path& folder, const std::string& text) {
  std::error_code error;  // the file's own says it
  std::filesystem::create_directories(folder, error);
  writeWholeFile((folder / "sensor.yaml").string(), text);
}

}  // namespace

void writeEstimatedCalibration(const std::string& folder, const Calibration& given,
                               const CalibrationEstimate& estimate, double rate_hz) {
  const std::filesystem::path root(folder);
  // The file's body again: the truth of a log may be given in it.
  const SE3 T_filebody_body = given.T_body_filebody.inverse();
  const std::string times =
      fmt::format("timeshift_cam_imu: {:.9f}\n", estimate.camera_to_imu_shift.seconds()) +
      shutterYaml(estimate.readout);
  for (std::size_t c = 0; c < given.rig.camera_count; ++c) {
    const double rate = given.camera_rate_hz[c] > 0 ? given.camera_rate_hz[c] : rate_hz;
    // A camera that was left out stays as given.
    const SE3& T_body_cam = estimate.rotation_sigma[c] > 0 ? estimate.T_body_cam[c] : given.rig.T_body_cam[c];
    writeSensor(root / fmt::format("cam{}", c), cameraYaml(given.rig.camera[c], T_filebody_body * T_body_cam,
                                                           rate, originText(estimate, c), times));
  }
  const SE3 T_filebody_imu(Eigen::Quaterniond(given.R_body_imu), T_filebody_body.translation);
  writeSensor(root / "imu0", imuYaml(given.noise, "as given", T_filebody_imu));
}

}  // namespace swiftlet
