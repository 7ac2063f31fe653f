#include "drivers/recorded/asl_text.hpp"

#include <fmt/format.h>

#include <Eigen/QR>

#include <iterator>

namespace swiftlet {
namespace {

std::string transformYaml(const SE3& T) {
  const Eigen::Matrix3d R = T.R();
  std::string text = "T_BS:\n  cols: 4\n  rows: 4\n  data: [";
  for (int row = 0; row < 3; ++row) {
    fmt::format_to(std::back_inserter(text), "{:.15g}, {:.15g}, {:.15g}, {:.15g},\n         ", R(row, 0),
                   R(row, 1), R(row, 2), T.translation[row]);
  }
  return text + "0.0, 0.0, 0.0, 1.0]\n";
}

}  // namespace

std::string cameraYaml(const CameraModel& camera, const SE3& T_body_cam, double rate_hz,
                       std::string_view origin, const std::string& extra) {
  const Eigen::Vector4d& k = camera.intrinsics();
  const Eigen::Vector4d& d = camera.distortion();
  const bool radtan = camera.kind() == CameraKind::kPinholeRadtan;
  return fmt::format(
      "sensor_type: camera\ncomment: {}\n{}rate_hz: {:g}\nresolution: [{}, {}]\ncamera_model: "
      "pinhole\n"
      "intrinsics: [{:.12g}, {:.12g}, {:.12g}, {:.12g}]\ndistortion_model: {}\n"
      "distortion_coefficients: [{:.12g}, {:.12g}, {:.12g}, {:.12g}]\n{}",
      origin, transformYaml(T_body_cam), rate_hz, camera.width(), camera.height(), k[0], k[1], k[2], k[3],
      radtan ? "radial-tangential" : "equidistant", d[0], d[1], d[2], d[3], extra);
}

std::string shutterYaml(Duration readout) {
  if (readout.ns == 0) return {};
  return fmt::format("shutter: rolling\nreadout_ms: {:.9g}\n", 1e3 * readout.seconds());
}

std::string imuYaml(const ImuNoise& noise, std::string_view origin, const SE3& T_body_imu,
                    const std::string& extra) {
  return fmt::format(
             "sensor_type: imu\ncomment: {}\n{}rate_hz: {:g}\ngyroscope_noise_density: {:g}\n"
             "gyroscope_random_walk: {:g}\naccelerometer_noise_density: {:g}\naccelerometer_random_walk: "
             "{:g}\n",
             origin, transformYaml(T_body_imu), noise.rate_hz, noise.gyro_density, noise.gyro_walk,
             noise.accel_density, noise.accel_walk) +
         extra;
}

std::string imuMatricesYaml(const Calibration& calibration) {
  if (!calibration.hasImuMatrices()) return {};
  // Kalibr's gyro matrix is a lower triangular matrix times a rotation: QR decomposition of the transpose.
  const Eigen::HouseholderQR<Eigen::Matrix3d> qr(calibration.gyro_matrix.transpose());
  Eigen::Matrix3d lower = Eigen::Matrix3d(qr.matrixQR().triangularView<Eigen::Upper>()).transpose();
  Eigen::Matrix3d C_gyro_i = Eigen::Matrix3d(qr.householderQ()).transpose();
  for (int k = 0; k < 3; ++k) {
    if (lower(k, k) > 0) continue;
    lower.col(k) *= -1;
    C_gyro_i.row(k) *= -1;
  }
  const auto rows = [](const char* key, const Eigen::Matrix3d& M) {
    std::string text = fmt::format("  {}:\n", key);
    for (int i = 0; i < 3; ++i) {
      text += fmt::format("  - [{:.15g}, {:.15g}, {:.15g}]\n", M(i, 0), M(i, 1), M(i, 2));
    }
    return text;
  };
  return "model: scale-misalignment\naccelerometers:\n" + rows("M", calibration.accel_matrix) +
         "gyroscopes:\n" + rows("A", calibration.gyro_by_force) + rows("C_gyro_i", C_gyro_i) +
         rows("M", lower);
}

std::string imuCsvHeader() {
  return "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],"
         "a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n";
}

std::string imuCsvRow(const ImuSample& s) {
  return fmt::format("{},{:.10g},{:.10g},{:.10g},{:.10g},{:.10g},{:.10g}\n", s.stamp.ns, s.gyro.x(),
                     s.gyro.y(), s.gyro.z(), s.accel.x(), s.accel.y(), s.accel.z());
}

}  // namespace swiftlet
