#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "drivers/calibration/calibration.hpp"

namespace swiftlet {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;

/// "+z" for the body axis nearest to `direction`, with the angle to it.
std::string nearestAxis(const Eigen::Vector3d& direction) {
  Eigen::Index axis = 0;
  direction.cwiseAbs().maxCoeff(&axis);
  const double cosine = std::clamp(std::abs(direction[axis]) / direction.norm(), 0.0, 1.0);
  return fmt::format("{}{} ({:.1f} deg off)", direction[axis] < 0 ? '-' : '+', "xyz"[axis],
                     std::acos(cosine) * kDegrees);
}

std::string describeCamera(const Calibration& calibration, std::size_t i) {
  const Rig& rig = calibration.rig;
  const double rate_hz = calibration.camera_rate_hz[i];
  const CameraModel& model = rig.camera[i];
  const SE3& T = rig.T_body_cam[i];
  const double fov = 2 * std::atan(0.5 * model.width() / model.intrinsics()[0]) * kDegrees;
  std::string text = fmt::format(
      "cam{}: {}x{}, {}, f ({:.3f}, {:.3f}) px, centre ({:.3f}, {:.3f}) px", i, model.width(), model.height(),
      model.kind() == CameraKind::kEquidistant ? "equidistant" : "pinhole radial-tangential",
      model.intrinsics()[0], model.intrinsics()[1], model.intrinsics()[2], model.intrinsics()[3]);
  if (model.kind() == CameraKind::kPinholeRadtan) text += fmt::format(", about {:.0f} deg wide", fov);
  if (rate_hz > 0) text += fmt::format(", {:g} Hz", rate_hz);
  if (!calibration.conversion[i].empty()) text += "\n      converted, " + calibration.conversion[i];
  text += fmt::format(
      "\n"
      "      at ({:.4f}, {:.4f}, {:.4f}) m in the body; optical axis along body {}, its right along body "
      "{}\n",
      T.translation.x(), T.translation.y(), T.translation.z(), nearestAxis(T.R().col(2)),
      nearestAxis(T.R().col(0)));
  return text;
}

}  // namespace

std::string describe(const Calibration& calibration) {
  const Rig& rig = calibration.rig;
  std::string text = fmt::format("{} calibration, {} camera{}\n", calibration.form, rig.camera_count,
                                 rig.camera_count == 1 ? "" : "s");
  for (std::size_t i = 0; i < rig.camera_count; ++i) {
    text += describeCamera(calibration, i);
  }
  if (rig.camera_count == 2) {
    const Eigen::Vector3d p_c0_c1 = rig.T_cam1_cam0().inverse().translation;
    text +=
        fmt::format("pair: baseline {:.4f} m; cam1 is {} of cam0, at ({:.4f}, {:.4f}, {:.4f}) m in cam0\n",
                    rig.baseline(), p_c0_c1.x() > 0 ? "to the right" : "to the left", p_c0_c1.x(),
                    p_c0_c1.y(), p_c0_c1.z());
  }
  const double shift_ms = 1e3 * rig.camera_to_imu_shift.seconds();
  text += fmt::format("time: {:+.3f} ms from image stamp to IMU clock\n", shift_ms);
  if (rig.rolls()) {
    text += fmt::format("rolling shutter: {:.3f} ms readout, stamps are of the middle row\n",
                        1e3 * rig.readout.seconds());
  }
  const ImuNoise& n = calibration.noise;
  const double root = std::sqrt(n.rate_hz);
  text += fmt::format(
      "IMU: {:g} Hz; gyro {:.3g} rad/s/sqrt(Hz) ({:.3g} rad/s per sample), accel {:.3g} m/s^2/sqrt(Hz) "
      "({:.3g} m/s^2 per sample)\n"
      "     random walks {:.3g} rad/s^2/sqrt(Hz), {:.3g} m/s^3/sqrt(Hz)\n",
      n.rate_hz, n.gyro_density, n.gyro_density * root, n.accel_density, n.accel_density * root, n.gyro_walk,
      n.accel_walk);
  if (calibration.turnsImu()) {
    text +=
        fmt::format("     rotated in the body: its x is body {}, its z is body {}\n",
                    nearestAxis(calibration.R_body_imu.col(0)), nearestAxis(calibration.R_body_imu.col(2)));
  }
  if (calibration.hasImuMatrices()) {
    const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
    text +=
        fmt::format("     scale and misalignment corrected: gyro up to {:.2f} %, accelerometer {:.2f} %\n",
                    100 * (calibration.gyro_matrix - identity).cwiseAbs().maxCoeff(),
                    100 * (calibration.accel_matrix - identity).cwiseAbs().maxCoeff());
  }
  return text;
}

}  // namespace swiftlet
