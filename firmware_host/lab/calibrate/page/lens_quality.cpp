#include "firmware_host/lab/calibrate/page/lens_quality.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
using LensJacobian = Eigen::Matrix<double, 2, 8>;

CameraModel with(const CameraModel& model, int parameter, double step) {
  Eigen::Vector4d intrinsics = model.intrinsics();
  Eigen::Vector4d distortion = model.distortion();
  (parameter < 4 ? intrinsics[parameter] : distortion[parameter - 4]) += step;
  return {model.kind(), model.width(), model.height(), intrinsics, distortion};
}

}  // namespace

std::vector<double> projectionSigmas(const CameraModel& model, const Eigen::Matrix<double, 8, 8>& covariance,
                                     const std::vector<Eigen::Vector2d>& pixels) {
  std::vector<LensJacobian> lens(pixels.size(), LensJacobian::Constant(kNone));
  std::vector<Matrix23d> turn(pixels.size(), Matrix23d::Zero());
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 8> coupling = Eigen::Matrix<double, 3, 8>::Zero();
  std::array<std::array<CameraModel, 2>, 8> moved;
  std::array<double, 8> step{};
  for (int i = 0; i < 8; ++i) {
    const auto at = static_cast<std::size_t>(i);
    step[at] = i < 4 ? 1e-3 * model.focal() : 1e-5;  // px; the distortion's coefficients are of order 0.1
    moved[at] = {with(model, i, -step[at]), with(model, i, step[at])};
  }
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    Eigen::Vector3d ray;
    Eigen::Vector2d pixel;
    Matrix23d by_point;
    if (!model.unproject(pixels[k], ray) || !model.project(ray, pixel, &by_point)) continue;
    LensJacobian J;
    bool good = true;
    for (std::size_t i = 0; i < 8; ++i) {
      Eigen::Vector2d low;
      Eigen::Vector2d high;
      good &= moved[i][0].project(ray, low) && moved[i][1].project(ray, high);
      J.col(static_cast<Eigen::Index>(i)) = (high - low) / (2 * step[i]);
    }
    if (!good) continue;
    lens[k] = J;
    turn[k] = -by_point * hat(ray);
    information += turn[k].transpose() * turn[k];
    coupling += turn[k].transpose() * J;
  }
  const Eigen::Matrix<double, 3, 8> compensating = information.ldlt().solve(coupling);
  std::vector<double> sigmas;
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    const LensJacobian A = lens[k] - turn[k] * compensating;
    if (!A.allFinite()) {
      sigmas.push_back(kNone);
      continue;
    }
    const Eigen::Matrix2d C = A * covariance * A.transpose();
    const double mean = C.trace() / 2;
    const double off = std::hypot((C(0, 0) - C(1, 1)) / 2, C(0, 1));
    sigmas.push_back(std::sqrt(std::max(0.0, mean + off)));
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
