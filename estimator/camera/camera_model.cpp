#include "estimator/camera/camera_model.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace swiftlet {
namespace {

constexpr int kMaxNewtonSteps = 20;
constexpr double kNewtonTolerance = 1e-12;
// Residual on the plane z = 1 at which the inversion of a radial-tangential lens ends: 5e-9 px, far below the
// resolution of a pixel coordinate in float.
constexpr double kMaxResidual = 1e-11;
// Radial-tangential lenses are limited to 85 degrees, where the tangent diverges.
constexpr double kMaxRadtanTheta = 1.483;
constexpr double kThetaStep = 1e-3;

// First radius where d(r (1 + k1 r^2 + k2 r^4)) / dr = 0, as an angle; bounded by kMaxRadtanTheta.
double radtanFoldAngle(double k1, double k2) {
  for (double theta = kThetaStep; theta < kMaxRadtanTheta; theta += kThetaStep) {
    const double r2 = std::tan(theta) * std::tan(theta);
    if (1.0 + 3.0 * k1 * r2 + 5.0 * k2 * r2 * r2 <= 0.0) return theta - kThetaStep;
  }
  return kMaxRadtanTheta;
}

double equidistantFoldAngle(const Eigen::Vector4d& k) {
  for (double theta = kThetaStep; theta < std::numbers::pi; theta += kThetaStep) {
    const double t2 = theta * theta;
    const double slope = 1.0 + t2 * (3.0 * k[0] + t2 * (5.0 * k[1] + t2 * (7.0 * k[2] + t2 * 9.0 * k[3])));
    if (slope <= 0.0) return theta - kThetaStep;
  }
  return std::numbers::pi - kThetaStep;
}

// Whether a point with this squared distance from the axis and this depth lies within the angle. The first
// terms of the tangent's series are a lower bound, so few points need the tangent itself.
bool within(double max_theta, double radius_squared, double z) {
  const double below = max_theta * (1.0 + max_theta * max_theta / 3.0) * z;
  if (radius_squared < below * below) return true;
  const double limit = std::tan(max_theta) * z;
  return radius_squared < limit * limit;
}

}  // namespace

CameraModel::CameraModel(CameraKind kind, int width, int height, const Eigen::Vector4d& intrinsics,
                         const Eigen::Vector4d& distortion)
    : kind_(kind),
      width_(width),
      height_(height),
      intrinsics_(intrinsics),
      distortion_(distortion),
      max_theta_(kind == CameraKind::kPinholeRadtan ? radtanFoldAngle(distortion[0], distortion[1])
                                                    : equidistantFoldAngle(distortion)) {}

bool CameraModel::project(const Eigen::Vector3d& p, Eigen::Vector2d& pixel, Matrix23d* jacobian) const {
  const double fx = intrinsics_[0];
  const double fy = intrinsics_[1];
  if (kind_ == CameraKind::kPinholeRadtan) {
    const double radius_squared = p.x() * p.x() + p.y() * p.y();
    if (!(p.z() > 0) || !within(max_theta_, radius_squared, p.z())) return false;
    const double inverse_z = 1.0 / p.z();
    const double x = p.x() * inverse_z;
    const double y = p.y() * inverse_z;
    const double k1 = distortion_[0];
    const double k2 = distortion_[1];
    const double p1 = distortion_[2];
    const double p2 = distortion_[3];
    const double r2 = x * x + y * y;
    const double radial = 1.0 + r2 * (k1 + r2 * k2);
    pixel.x() = fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + intrinsics_[2];
    pixel.y() = fy * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + intrinsics_[3];
    if (jacobian != nullptr) {
      const double dradial = 2.0 * (k1 + 2.0 * k2 * r2);  // d radial / d r2 * 2
      Eigen::Matrix2d d;
      d(0, 0) = radial + dradial * x * x + 2 * p1 * y + 6 * p2 * x;
      d(0, 1) = dradial * x * y + 2 * p1 * x + 2 * p2 * y;
      d(1, 0) = d(0, 1);
      d(1, 1) = radial + dradial * y * y + 6 * p1 * y + 2 * p2 * x;
      d.row(0) *= fx;
      d.row(1) *= fy;
      Matrix23d n;
      n << inverse_z, 0, -x * inverse_z, 0, inverse_z, -y * inverse_z;
      *jacobian = d * n;
    }
    return true;
  }

  const double r2 = p.x() * p.x() + p.y() * p.y();
  const double r = std::sqrt(r2);
  const double theta = std::atan2(r, p.z());
  if (!(theta <= max_theta_)) return false;
  const Eigen::Vector4d& k = distortion_;
  const double t2 = theta * theta;
  const double poly = 1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])));
  const double norm2 = r2 + p.z() * p.z();
  if (!(norm2 > 0)) return false;
  // Near the axis theta_d / r -> poly / z, by the series of atan.
  const bool near_axis = r < 1e-9 * p.z();
  const double scale = near_axis ? poly / p.z() : theta * poly / r;
  pixel.x() = fx * scale * p.x() + intrinsics_[2];
  pixel.y() = fy * scale * p.y() + intrinsics_[3];
  if (jacobian != nullptr) {
    Eigen::Vector3d dscale = Eigen::Vector3d::Zero();  // gradient of scale
    if (near_axis) {
      dscale.z() = -scale / p.z();
    } else {
      const double slope = 1.0 + t2 * (3 * k[0] + t2 * (5 * k[1] + t2 * (7 * k[2] + t2 * 9 * k[3])));
      const double dtheta_dr = p.z() / norm2;
      const double radial = (slope * dtheta_dr - scale) / r;  // d scale / d r
      dscale = {radial * p.x() / r, radial * p.y() / r, -slope / norm2};
    }
    jacobian->row(0) = fx * p.x() * dscale.transpose();
    jacobian->row(1) = fy * p.y() * dscale.transpose();
    (*jacobian)(0, 0) += fx * scale;
    (*jacobian)(1, 1) += fy * scale;
  }
  return true;
}

bool CameraModel::unproject(const Eigen::Vector2d& pixel, Eigen::Vector3d& bearing) const {
  const double xd = (pixel.x() - intrinsics_[2]) / intrinsics_[0];
  const double yd = (pixel.y() - intrinsics_[3]) / intrinsics_[1];
  if (!std::isfinite(xd) || !std::isfinite(yd)) return false;
  const Eigen::Vector4d& k = distortion_;
  if (kind_ == CameraKind::kEquidistant) {
    const double rd = std::hypot(xd, yd);
    if (rd < 1e-12) {
      bearing = Eigen::Vector3d::UnitZ();
      return true;
    }
    double theta = std::min(rd, max_theta_);
    for (int i = 0; i < kMaxNewtonSteps; ++i) {
      const double t2 = theta * theta;
      const double value = theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])))) - rd;
      const double slope = 1 + t2 * (3 * k[0] + t2 * (5 * k[1] + t2 * (7 * k[2] + t2 * 9 * k[3])));
      const double step = value / slope;
      theta = std::clamp(theta - step, 0.0, max_theta_);
      if (std::abs(step) < kNewtonTolerance) break;
    }
    const double t2 = theta * theta;
    const double residual = theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])))) - rd;
    if (std::abs(residual) > 1e-6) return false;
    const double s = std::sin(theta) / rd;
    bearing = {xd * s, yd * s, std::cos(theta)};
    return true;
  }

  // Newton on the 2D distortion from the distorted point; two to four steps inside the fold.
  double x = xd;
  double y = yd;
  for (int i = 0; i < kMaxNewtonSteps; ++i) {
    const double r2 = x * x + y * y;
    const double radial = 1 + r2 * (k[0] + r2 * k[1]);
    const double ex = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x) - xd;
    const double ey = y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y - yd;
    if (ex * ex + ey * ey < kMaxResidual * kMaxResidual) {
      if (!within(max_theta_, r2, 1)) return false;
      bearing = Eigen::Vector3d(x, y, 1) / std::sqrt(1 + r2);
      return true;
    }
    const double dradial = 2 * (k[0] + 2 * k[1] * r2);
    const double a = radial + dradial * x * x + 2 * k[2] * y + 6 * k[3] * x;
    const double b = dradial * x * y + 2 * k[2] * x + 2 * k[3] * y;
    const double d = radial + dradial * y * y + 6 * k[2] * y + 2 * k[3] * x;
    const double det = a * d - b * b;
    if (!(std::abs(det) > 1e-9)) return false;
    const double inverse = 1 / det;
    x -= (d * ex - b * ey) * inverse;
    y -= (a * ey - b * ex) * inverse;
  }
  return false;
}

}  // namespace swiftlet
