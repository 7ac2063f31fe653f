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

constexpr int kRotationSteps = 10;
/// px: beyond it two lenses share nothing there, and one such point must not turn all of them.
constexpr double kFarApart = 50;

/// Of a pixel; by the lens NaN where it has no ray.
struct PixelDerivatives {
  Eigen::Matrix<double, 2, 8> by_lens =
      Eigen::Matrix<double, 2, 8>::Constant(std::numeric_limits<double>::quiet_NaN());
  Eigen::Matrix<double, 2, 3> by_rotation = Eigen::Matrix<double, 2, 3>::Zero();
};

struct GridPoint {
  Eigen::Vector2d pixel;
  Eigen::Vector3d bearing;
};

std::vector<GridPoint> gridOf(const CameraModel& lens) {
  std::vector<GridPoint> points;
  for (int row = 0; row < kImageGridRows; ++row) {
    for (int column = 0; column < kImageGridColumns; ++column) {
      GridPoint point;
      point.pixel = {(lens.width() - 1.0) * column / (kImageGridColumns - 1),
                     (lens.height() - 1.0) * row / (kImageGridRows - 1)};
      if (lens.unproject(point.pixel, point.bearing)) points.push_back(point);
    }
  }
  return points;
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

std::vector<ImagePoint> projectionSigmas(const CameraModel& lens,
                                         const Eigen::Matrix<double, 8, 8>& covariance) {
  std::vector<Eigen::Vector2d> pixels;
  for (const GridPoint& point : gridOf(lens)) pixels.push_back(point.pixel);
  const std::vector<Eigen::Matrix2d> covariances = pixelCovariances(lens, covariance, pixels);
  std::vector<ImagePoint> points;
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    if (covariances[k].allFinite()) points.push_back({pixels[k], std::sqrt(0.5 * covariances[k].trace())});
  }
  return points;
}

std::vector<ImagePoint> projectionDifference(const CameraModel& lens, const CameraModel& other) {
  const std::vector<GridPoint> grid = gridOf(lens);
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  std::vector<ImagePoint> points;
  for (int step = 0; step <= kRotationSteps; ++step) {
    points.clear();
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (const GridPoint& point : grid) {
      Eigen::Vector2d pixel;
      Matrix23d by_point;
      if (!other.project(turn * point.bearing, pixel, &by_point)) continue;
      const Eigen::Vector2d r = point.pixel - pixel;
      points.push_back({point.pixel, std::sqrt(0.5 * r.squaredNorm())});
      if (r.norm() > kFarApart) continue;
      const Eigen::Matrix<double, 2, 3> J = -by_point * turn.toRotationMatrix() * hat(point.bearing);
      normal += J.transpose() * J;
      gradient += J.transpose() * r;
    }
    const Eigen::Vector3d change = normal.ldlt().solve(gradient);
    if (step < kRotationSteps && change.allFinite()) turn = (turn * expSo3(change)).normalized();
  }
  return points;
}

double rms(const std::vector<ImagePoint>& points) {
  double sum = 0;
  for (const ImagePoint& point : points) sum += point.error * point.error;
  return points.empty() ? std::numeric_limits<double>::infinity()
                        : std::sqrt(sum / static_cast<double>(points.size()));
}

double quantile(const std::vector<ImagePoint>& points, double part) {
  if (points.empty()) return std::numeric_limits<double>::infinity();
  std::vector<double> errors;
  for (const ImagePoint& point : points) errors.push_back(point.error);
  std::sort(errors.begin(), errors.end());
  return errors[static_cast<std::size_t>(part * static_cast<double>(errors.size() - 1))];
}

}  // namespace swiftlet
