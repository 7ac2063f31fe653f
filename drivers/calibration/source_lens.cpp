#include "drivers/calibration/source_lens.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace swiftlet {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// OpenCV's 14 coefficients applied to a point of the plane z = 1. False if a denominator is zero.
bool brown(const std::array<double, 14>& k, Vector2d& point) {
  const auto [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y] = k;
  const double x = point.x();
  const double y = point.y();
  const double r2 = x * x + y * y;
  const double below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6));
  if (!(below > 0)) return false;
  const double radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / below;
  point.x() = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2);
  point.y() = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4);
  if (tau_x == 0 && tau_y == 0) return true;
  // The sensor plane is tilted: project the point onto it through the centre.
  const Eigen::Matrix3d R = (Eigen::AngleAxisd(-tau_y, Vector3d::UnitY()).toRotationMatrix() *
                             Eigen::AngleAxisd(-tau_x, Vector3d::UnitX()).toRotationMatrix());
  const Vector3d turned = R * point.homogeneous();
  if (!(turned.z() > 0)) return false;
  point.x() = (R(2, 2) * turned.x() - R(0, 2) * turned.z()) / turned.z();
  point.y() = (R(2, 2) * turned.y() - R(1, 2) * turned.z()) / turned.z();
  return true;
}

}  // namespace

bool SourceLens::project(const Vector3d& p, Vector2d& pixel) const {
  const double d = p.norm();
  const double radius = p.head<2>().norm();
  Vector2d point;
  double below = p.z();
  switch (family) {
    case LensFamily::kBrown:
      if (!(below > 0) || (max_radius > 0 && radius > max_radius * below)) return false;
      point = p.head<2>() / below;
      if (!brown(distortion, point)) return false;
      break;
    case LensFamily::kEquidistant: {
      if (!(d > 0)) return false;
      const double theta = std::atan2(radius, p.z());
      const double t2 = theta * theta;
      const auto& k = distortion;
      const double theta_d = theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
      point = radius > 0 ? Vector2d(p.head<2>() * (theta_d / radius)) : Vector2d::Zero();
      break;
    }
    case LensFamily::kOmni:
      below = p.z() + shape[0] * d;
      if (!(below > 0)) return false;
      point = p.head<2>() / below;
      if (!brown(distortion, point)) return false;
      break;
    case LensFamily::kDoubleSphere: {
      const auto [xi, alpha] = shape;
      const double shifted = xi * d + p.z();
      below = alpha * std::hypot(radius, shifted) + (1 - alpha) * shifted;
      if (!(below > 0)) return false;
      point = p.head<2>() / below;
      break;
    }
    case LensFamily::kExtendedUnified: {
      const auto [alpha, beta] = shape;
      below = alpha * std::sqrt(beta * radius * radius + p.z() * p.z()) + (1 - alpha) * p.z();
      if (!(below > 0)) return false;
      point = p.head<2>() / below;
      break;
    }
    case LensFamily::kFieldOfView: {
      if (!(below > 0)) return false;
      const double w = shape[0];
      const double bent = std::atan(2 * std::tan(0.5 * w) * radius / below) / w;
      point = radius > 0 ? Vector2d(p.head<2>() * (bent / radius)) : Vector2d::Zero();
      break;
    }
  }
  pixel = intrinsics.head<2>().cwiseProduct(point) + intrinsics.tail<2>();
  return pixel.allFinite();
}

}  // namespace swiftlet
