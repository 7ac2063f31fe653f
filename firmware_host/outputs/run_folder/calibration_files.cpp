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

/// Describes what was estimated of a camera, and how well.
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
  text += " the rest unchanged";
  return text;
}

void writeSensor(const std::filesystem::path& folder, const std::string& text) {
  std::error_code error;  // ignored: the file itself reports the error
  std::filesystem::create_directories(folder, error);
  writeWholeFile((folder / "sensor.yaml").string(), text);
}

void writeImu(const std::filesystem::path& root, const Calibration& given, const std::string& origin) {
  const SE3 T_filebody_imu(Eigen::Quaterniond(given.R_body_imu), given.T_body_filebody.inverse().translation);
  writeSensor(root / "imu0", imuYaml(given.noise, origin, T_filebody_imu, imuMatricesYaml(given)));
}

std::string shiftYaml(Duration shift) { return fmt::format("timeshift_cam_imu: {:.9f}\n", shift.seconds()); }

std::string kalibrCamera(const Calibration& given, std::size_t c) {
  const CameraModel& lens = given.rig.camera[c];
  const Eigen::Vector4d& k = lens.intrinsics();
  const Eigen::Vector4d& d = lens.distortion();
  const SE3 T_body_imu(Eigen::Quaterniond(given.R_body_imu), Eigen::Vector3d::Zero());
  const SE3 T_cam_imu = given.rig.T_body_cam[c].inverse() * T_body_imu;
  const Eigen::Matrix3d R = T_cam_imu.R();
  std::string text = fmt::format("cam{}:\n  T_cam_imu:\n", c);
  for (int row = 0; row < 3; ++row) {
    text += fmt::format("  - [{:.15g}, {:.15g}, {:.15g}, {:.15g}]\n", R(row, 0), R(row, 1), R(row, 2),
                        T_cam_imu.translation[row]);
  }
  text += fmt::format(
      "  - [0.0, 0.0, 0.0, 1.0]\n  camera_model: pinhole\n  intrinsics: [{:.12g}, {:.12g}, {:.12g}, "
      "{:.12g}]\n"
      "  distortion_model: {}\n  distortion_coeffs: [{:.12g}, {:.12g}, {:.12g}, {:.12g}]\n  resolution: [{}, "
      "{}]\n"
      "  timeshift_cam_imu: {:.9f}\n",
      k[0], k[1], k[2], k[3], lens.kind() == CameraKind::kPinholeRadtan ? "radtan" : "equidistant", d[0],
      d[1], d[2], d[3], lens.width(), lens.height(), given.rig.camera_to_imu_shift.seconds());
  if (!given.camera_topic[c].empty()) text += fmt::format("  rostopic: {}\n", given.camera_topic[c]);
  if (given.rig.rolls()) {
    text += fmt::format("  shutter: rolling\n  readout_ms: {:.9g}\n", kToMs * given.rig.readout.seconds());
  }
  return text;
}

std::string kalibrImu(const Calibration& given) {
  const ImuNoise& n = given.noise;
  std::string text = fmt::format(
      "update_rate: {:g}\ngyroscope_noise_density: {:g}\ngyroscope_random_walk: {:g}\n"
      "accelerometer_noise_density: {:g}\naccelerometer_random_walk: {:g}\n",
      n.rate_hz, n.gyro_density, n.gyro_walk, n.accel_density, n.accel_walk);
  text += imuMatricesYaml(given);
  if (!given.imu_topic.empty()) text += fmt::format("rostopic: {}\n", given.imu_topic);
  return text;
}

}  // namespace

void writeEstimatedCalibration(const std::string& folder, const Calibration& given,
                               const CalibrationEstimate& estimate, double rate_hz) {
  const std::filesystem::path root(folder);
  // Written in the file's original body frame, in which a log's truth may be given.
  const SE3 T_filebody_body = given.T_body_filebody.inverse();
  const std::string times = shiftYaml(estimate.camera_to_imu_shift) + shutterYaml(estimate.readout);
  for (std::size_t c = 0; c < given.rig.camera_count; ++c) {
    const double rate = given.camera_rate_hz[c] > 0 ? given.camera_rate_hz[c] : rate_hz;
    // A camera that was not estimated keeps its given extrinsics.
    const SE3& T_body_cam = estimate.rotation_sigma[c] > 0 ? estimate.T_body_cam[c] : given.rig.T_body_cam[c];
    writeSensor(root / fmt::format("cam{}", c), cameraYaml(given.rig.camera[c], T_filebody_body * T_body_cam,
                                                           rate, originText(estimate, c), times));
  }
  writeImu(root, given, "as given");
}

void writeCalibration(const std::string& folder, const Calibration& calibration, const std::string& origin) {
  const std::filesystem::path root(folder);
  const Rig& rig = calibration.rig;
  const std::string times = shiftYaml(rig.camera_to_imu_shift) + shutterYaml(rig.readout);
  std::string chain;
  for (std::size_t c = 0; c < rig.camera_count; ++c) {
    const std::string text =
        calibration.conversion[c].empty() ? origin : "converted; " + calibration.conversion[c];
    writeSensor(root / fmt::format("cam{}", c),
                cameraYaml(rig.camera[c], calibration.T_body_filebody.inverse() * rig.T_body_cam[c],
                           calibration.camera_rate_hz[c], fmt::format("\"{}\"", text), times));
    chain += kalibrCamera(calibration, c);
  }
  writeImu(root, calibration, origin);
  writeWholeFile((root / "camchain-imucam.yaml").string(), chain);
  writeWholeFile((root / "imu.yaml").string(), kalibrImu(calibration));
}

}  // namespace swiftlet
