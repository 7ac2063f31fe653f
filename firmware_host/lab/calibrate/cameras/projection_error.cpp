#include "firmware_host/lab/calibrate/cameras/projection_error.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/calibrate/cameras/lens_jacobian.hpp"

namespace swiftlet {
namespace {

constexpr int kRotationSteps = 12;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// Derivatives of a pixel; by_lens is NaN where the pixel has no ray.
struct PixelDerivatives {
  Eigen::Matrix<double, 2, 8> by_lens = Eigen::Matrix<double, 2, 8>::Constant(kNone);
  Eigen::Matrix<double, 2, 3> by_rotation = Eigen::Matrix<double, 2, 3>::Zero();
};

/// Pixels of the grid.
std::vector<Eigen::Vector2d> gridOf(const CameraModel& lens) {
  std::vector<Eigen::Vector2d> pixels;
  for (int row = 0; row < kImageGridRows; ++row) {
    for (int column = 0; column < kImageGridColumns; ++column) {
      pixels.emplace_back((lens.width() - 1.0) * column / (kImageGridColumns - 1),
                          (lens.height() - 1.0) * row / (kImageGridRows - 1));
    }
  }
  return pixels;
}

}  // namespace

std::vector<Eigen::Matrix2d> pixelCovariances(const CameraModel& lens,
                                              const Eigen::Matrix<double, 8, 8>& covariance,
                                              const std::vector<Eigen::Vector2d>& pixels) {
  std::vector<PixelDerivatives> all(pixels.size());
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 8> mixed = Eigen::Matrix<double, 3, 8>::Zero();
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    Eigen::Vector3d bearing;
    Eigen::Vector2d pixel;
    Matrix23d by_point;
    if (!lens.unproject(pixels[k], bearing) || !lens.project(bearing, pixel, &by_point)) continue;
    PixelDerivatives& d = all[k];
    d.by_lens = lensJacobian(lens, bearing);
    d.by_rotation = -by_point * hat(bearing);
    normal += d.by_rotation.transpose() * d.by_rotation;
    mixed += d.by_rotation.transpose() * d.by_lens;
  }
  const Eigen::Matrix<double, 3, 8> rotation = -normal.ldlt().solve(mixed);
  std::vector<Eigen::Matrix2d> covariances;
  for (const PixelDerivatives& d : all) {
    const Eigen::Matrix<double, 2, 8> J = d.by_lens + d.by_rotation * rotation;
    covariances.emplace_back(J * covariance * J.transpose());
  }
  return covariances;
}

std::vector<double> worstSigmas(const CameraModel& lens, const Eigen::Matrix<double, 8, 8>& covariance,
                                const std::vector<Eigen::Vector2d>& pixels) {
  std::vector<double> sigmas;
  for (const Eigen::Matrix2d& C : pixelCovariances(lens, covariance, pixels)) {
    const double off = std::hypot((C(0, 0) - C(1, 1)) / 2, C(0, 1));
    sigmas.push_back(C.allFinite() ? std::sqrt(C.trace() / 2 + off) : kNone);
  }
  return sigmas;
}

std::vector<double> rmsSigmas(const CameraModel& lens, const Eigen::Matrix<double, 8, 8>& covariance,
                              const std::vector<Eigen::Vector2d>& pixels) {
  std::vector<double> sigmas;
  for (const Eigen::Matrix2d& C : pixelCovariances(lens, covariance, pixels)) {
    sigmas.push_back(std::sqrt(0.5 * C.trace()));
  }
  return sigmas;
}

std::vector<ImagePoint> projectionSigmas(const CameraModel& lens,
                                         const Eigen::Matrix<double, 8, 8>& covariance) {
  const std::vector<Eigen::Vector2d> pixels = gridOf(lens);
  const std::vector<double> sigmas = rmsSigmas(lens, covariance, pixels);
  std::vector<ImagePoint> points;
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    if (std::isfinite(sigmas[k])) {
      points.push_back({pixels[k], sigmas[k]});
    } else if (lens.kind() == CameraKind::kPinholeRadtan) {
      points.push_back({pixels[k], std::numeric_limits<double>::infinity()});
    }
  }
  return points;
}

double rayShare(const CameraModel& lens) {
  const std::vector<Eigen::Vector2d> pixels = gridOf(lens);
  const auto rays = std::count_if(pixels.begin(), pixels.end(), [&lens](const Eigen::Vector2d& pixel) {
    Eigen::Vector3d ray;
    return lens.unproject(pixel, ray);
  });
  return static_cast<double>(rays) / static_cast<double>(pixels.size());
}

std::vector<Eigen::Vector2d> projectionDifference(const CameraModel& lens, const CameraModel& other,
                                                  const std::vector<Eigen::Vector2d>& pixels,
                                                  const std::vector<bool>& fit) {
  std::vector<Eigen::Vector3d> rays(pixels.size(), Eigen::Vector3d::Constant(kNone));
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    Eigen::Vector3d ray;
    if (lens.unproject(pixels[k], ray)) rays[k] = ray;
  }
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  for (int step = 0; step < kRotationSteps; ++step) {
    Eigen::Matrix3d H = 1e-9 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < pixels.size(); ++k) {
      if (!fit[k] || !rays[k].allFinite()) continue;
      Eigen::Vector2d pixel;
      Matrix23d by_point;
      if (!other.project(turn * rays[k], pixel, &by_point)) continue;
      const Matrix23d J = -by_point * turn.toRotationMatrix() * hat(rays[k]);
      const Eigen::Vector2d off = pixel - pixels[k];
      const double weight = 1 / (1 + off.squaredNorm());
      H += weight * J.transpose() * J;
      g -= weight * J.transpose() * off;
    }
    turn = (turn * expSo3(H.ldlt().solve(g))).normalized();
  }
  std::vector<Eigen::Vector2d> difference;
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    Eigen::Vector2d pixel;
    const bool good = rays[k].allFinite() && other.project(turn * rays[k], pixel);
    difference.push_back(good ? Eigen::Vector2d(pixel - pixels[k]) : Eigen::Vector2d::Constant(kNone));
  }
  return difference;
}

std::vector<ImagePoint> projectionDifference(const CameraModel& lens, const CameraModel& other) {
  const std::vector<Eigen::Vector2d> pixels = gridOf(lens);
  const std::vector<Eigen::Vector2d> difference =
      projectionDifference(lens, other, pixels, std::vector<bool>(pixels.size(), true));
  std::vector<ImagePoint> points;
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    if (difference[k].allFinite())
      points.push_back({pixels[k], std::sqrt(0.5 * difference[k].squaredNorm())});
  }
  return points;
}

double rms(const std::vector<ImagePoint>& points) {
  double sum = 0;
  double count = 0;
  for (const ImagePoint& point : points) {
    if (!std::isfinite(point.error)) continue;
    sum += point.error * point.error;
    ++count;
  }
  return count > 0 ? std::sqrt(sum / count) : std::numeric_limits<double>::infinity();
}

double quantile(const std::vector<ImagePoint>& points, double part) {
  if (points.empty()) return std::numeric_limits<double>::infinity();
  std::vector<double> errors;
  for (const ImagePoint& point : points) errors.push_back(point.error);
  std::sort(errors.begin(), errors.end());
  return errors[static_cast<std::size_t>(part * static_cast<double>(errors.size() - 1))];
}

}  // namespace swiftlet
