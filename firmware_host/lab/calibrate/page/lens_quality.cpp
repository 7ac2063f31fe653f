#include "firmware_host/lab/calibrate/page/lens_quality.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/calibrate/cameras/projection_error.hpp"

namespace swiftlet {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

}  // namespace

std::vector<double> projectionSigmas(const CameraModel& model, const Eigen::Matrix<double, 8, 8>& covariance,
                                     const std::vector<Eigen::Vector2d>& pixels) {
  std::vector<double> sigmas;
  for (const Eigen::Matrix2d& C : pixelCovariances(model, covariance, pixels)) {
    const double off = std::hypot((C(0, 0) - C(1, 1)) / 2, C(0, 1));
    sigmas.push_back(C.allFinite() ? std::sqrt(C.trace() / 2 + off) : kNone);
  }
  return sigmas;
}

std::vector<Eigen::Vector2d> projectionDifference(const CameraModel& a, const CameraModel& b,
                                                  const std::vector<Eigen::Vector2d>& pixels,
                                                  const std::vector<bool>& fit) {
  std::vector<Eigen::Vector3d> rays(pixels.size(), Eigen::Vector3d::Constant(kNone));
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    Eigen::Vector3d ray;
    if (a.unproject(pixels[k], ray)) rays[k] = ray;
  }
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  constexpr int kIterations = 12;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Matrix3d H = 1e-9 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < pixels.size(); ++k) {
      if (!fit[k] || !rays[k].allFinite()) continue;
      Eigen::Vector2d pixel;
      Matrix23d by_point;
      if (!b.project(turn * rays[k], pixel, &by_point)) continue;
      const Matrix23d J = -by_point * turn.toRotationMatrix() * hat(rays[k]);
      const Eigen::Vector2d off = pixel - pixels[k];
      const double weight = 1 / (1 + off.squaredNorm());
      H += weight * J.transpose() * J;
      g -= weight * J.transpose() * off;
    }
    turn = turn * expSo3(H.ldlt().solve(g));
  }
  std::vector<Eigen::Vector2d> difference;
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    Eigen::Vector2d pixel;
    const bool good = rays[k].allFinite() && b.project(turn * rays[k], pixel);
    difference.push_back(good ? Eigen::Vector2d(pixel - pixels[k]) : Eigen::Vector2d::Constant(kNone));
  }
  return difference;
}

}  // namespace swiftlet
