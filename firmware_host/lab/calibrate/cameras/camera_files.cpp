#include "firmware_host/lab/calibrate/cameras/camera_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/calibrate/cameras/projection_error.hpp"

namespace swiftlet {
namespace {

constexpr double kShownPart = 0.95;  ///< of the image

std::string list(const Eigen::Vector4d& values) {
  return fmt::format("[{:.10g}, {:.10g}, {:.10g}, {:.10g}]", values[0], values[1], values[2], values[3]);
}

}  // namespace

std::string describe(const CameraSolution& solution) {
  std::string text;
  for (std::size_t c = 0; c < solution.camera_count; ++c) {
    const SolvedCamera& camera = solution.camera[c];
    if (camera.model.width() == 0) continue;
    const Eigen::Matrix<double, 8, 1> sigma = camera.covariance.diagonal().cwiseSqrt();
    const Eigen::Vector4d& f = camera.model.intrinsics();
    text += fmt::format("camera {}: {}\n", c, camera.why_this_model);
    text += fmt::format(
        "  focal length {:.3f} {:.3f} px (1 sigma {:.3f} {:.3f}), centre {:.3f} {:.3f} px ({:.3f} {:.3f})\n",
        f[0], f[1], sigma[0], sigma[1], f[2], f[3], sigma[2], sigma[3]);
    text += fmt::format(
        "  corners rms {:.3f} px per axis; a projected pixel is uncertain by {:.3f} px (1 sigma, in {:.0f} % "
        "of the image); solutions from halves of the views differ by {:.3f} px rms\n",
        camera.rms, quantile(projectionSigmas(camera.model, camera.covariance), kShownPart), kShownPart * 100,
        rms(projectionDifference(camera.halves[0], camera.halves[1])));
    if (const double rays = rayShare(camera.model); rays < 1) {
      text += fmt::format("  {:.0f} % of the image has no ray in this model\n", 100 * (1 - rays));
    }
  }
  if (solution.camera_count == 2 && !solution.views.empty()) {
    const Eigen::Matrix<double, 6, 1> sigma = solution.stereo_covariance.diagonal().cwiseSqrt();
    text += fmt::format(
        "baseline {:.2f} mm (1 sigma {:.3f} mm), rotation between the cameras {:.3f} degrees ({:.4f})\n",
        solution.T_cam1_cam0.translation.norm() * 1e3, sigma.tail<3>().norm() * 1e3,
        logSo3(solution.T_cam1_cam0.rotation).norm() * 180 / std::numbers::pi,
        sigma.head<3>().norm() * 180 / std::numbers::pi);
  }
  if (!solution.corners.empty()) {
    const auto outliers = std::count_if(solution.corners.begin(), solution.corners.end(),
                                        [](const CornerResidual& corner) { return corner.outlier; });
    text += fmt::format("{} views, {} corners, {} of them rejected as outliers\n", solution.views.size(),
                        solution.corners.size(), outliers);
  }
  return text;
}

std::string camchainYaml(const CameraSolution& solution) {
  std::string text =
      "# Written by swiftlet calibrate cameras. It has no IMU: add it with swiftlet calibrate imu-camera.\n";
  for (std::size_t c = 0; c < solution.camera_count; ++c) {
    const CameraModel& lens = solution.camera[c].model;
    text += fmt::format("cam{}:\n  camera_model: pinhole\n  distortion_model: {}\n", c,
                        lens.kind() == CameraKind::kEquidistant ? "equidistant" : "radtan");
    text += fmt::format("  distortion_coeffs: {}\n  intrinsics: {}\n  resolution: [{}, {}]\n",
                        list(lens.distortion()), list(lens.intrinsics()), lens.width(), lens.height());
    if (c == 0) continue;
    const Eigen::Matrix3d R = solution.T_cam1_cam0.R();
    const Eigen::Vector3d& t = solution.T_cam1_cam0.translation;
    text += "  T_cn_cnm1:\n";
    for (int row = 0; row < 3; ++row) {
      text +=
          fmt::format("  - [{:.12f}, {:.12f}, {:.12f}, {:.12f}]\n", R(row, 0), R(row, 1), R(row, 2), t[row]);
    }
    text += "  - [0.0, 0.0, 0.0, 1.0]\n";
  }
  return text;
}

}  // namespace swiftlet
