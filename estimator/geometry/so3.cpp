#include "estimator/geometry/so3.hpp"

#include <cmath>

namespace swiftlet {
namespace {

// Below this squared angle the second-order Taylor terms are exact to double rounding.
constexpr double kSmallAngleSquared = 1e-8;

}  // namespace

Eigen::Quaterniond expSo3(const Eigen::Vector3d& phi) {
  const double angle_squared = phi.squaredNorm();
  double real = 0;
  double imaginary = 0;  // sin(angle / 2) / angle
  if (angle_squared < kSmallAngleSquared) {
    real = 1.0 - angle_squared / 8.0;
    imaginary = 0.5 - angle_squared / 48.0;
  } else {
    const double angle = std::sqrt(angle_squared);
    real = std::cos(0.5 * angle);
    imaginary = std::sin(0.5 * angle) / angle;
  }
  return {real, imaginary * phi.x(), imaginary * phi.y(), imaginary * phi.z()};
}

Eigen::Matrix3d expSo3Matrix(const Eigen::Vector3d& phi) { return expSo3(phi).toRotationMatrix(); }

Eigen::Vector3d logSo3(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0 ? -1.0 : 1.0;
  const double norm = q.vec().norm();
  const double w = sign * q.w();
  // 2 atan2(n, w) / n, by its series where n vanishes.
  const double scale = norm * norm < kSmallAngleSquared ? 2.0 / w - 2.0 / 3.0 * norm * norm / (w * w * w)
                                                        : 2.0 * std::atan2(norm, w) / norm;
  return sign * scale * q.vec();
}

Eigen::Vector3d logSo3(const Eigen::Matrix3d& R) { return logSo3(Eigen::Quaterniond(R)); }

Eigen::Matrix3d rightJacobianSo3(const Eigen::Vector3d& phi) {
  const double angle_squared = phi.squaredNorm();
  const Eigen::Matrix3d phi_hat = hat(phi);
  double a = 0;  // (1 - cos) / angle^2
  double b = 0;  // (angle - sin) / angle^3
  if (angle_squared < kSmallAngleSquared) {
    a = 0.5 - angle_squared / 24.0;
    b = 1.0 / 6.0 - angle_squared / 120.0;
  } else {
    const double angle = std::sqrt(angle_squared);
    a = (1.0 - std::cos(angle)) / angle_squared;
    b = (angle - std::sin(angle)) / (angle_squared * angle);
  }
  return Eigen::Matrix3d::Identity() - a * phi_hat + b * phi_hat * phi_hat;
}

Eigen::Matrix3d rightJacobianInverseSo3(const Eigen::Vector3d& phi) {
  const double angle_squared = phi.squaredNorm();
  const Eigen::Matrix3d phi_hat = hat(phi);
  double c = 0;  // 1 / angle^2 - (1 + cos) / (2 angle sin)
  if (angle_squared < kSmallAngleSquared) {
    c = 1.0 / 12.0 + angle_squared / 720.0;
  } else {
    const double half = 0.5 * std::sqrt(angle_squared);
    c = (1.0 - half * std::cos(half) / std::sin(half)) / angle_squared;
  }
  return Eigen::Matrix3d::Identity() + 0.5 * phi_hat + c * phi_hat * phi_hat;
}

}  // namespace swiftlet
