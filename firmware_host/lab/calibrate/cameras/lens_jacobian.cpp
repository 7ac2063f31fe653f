#include "firmware_host/lab/calibrate/cameras/lens_jacobian.hpp"

#include <cmath>

namespace swiftlet {

Eigen::Matrix<double, 2, kLensParameters> lensJacobian(const CameraModel& lens, const Eigen::Vector3d& p) {
  const double fx = lens.intrinsics()[0];
  const double fy = lens.intrinsics()[1];
  const Eigen::Vector4d& k = lens.distortion();
  Eigen::Matrix<double, 2, kLensParameters> J = Eigen::Matrix<double, 2, kLensParameters>::Zero();
  J(0, 2) = 1;
  J(1, 3) = 1;
  if (lens.kind() == CameraKind::kPinholeRadtan) {
    const double x = p.x() / p.z();
    const double y = p.y() / p.z();
    const double r2 = x * x + y * y;
    const double radial = 1 + r2 * (k[0] + r2 * k[1]);
    J(0, 0) = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x);
    J(1, 1) = y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y;
    J.row(0).tail<4>() << fx * x * r2, fx * x * r2 * r2, fx * 2 * x * y, fx * (r2 + 2 * x * x);
    J.row(1).tail<4>() << fy * y * r2, fy * y * r2 * r2, fy * (r2 + 2 * y * y), fy * 2 * x * y;
    return J;
  }
  const double r = p.head<2>().norm();
  const double theta = std::atan2(r, p.z());
  if (r < 1e-9 * std::abs(p.z())) return J;  // on the axis, only the centre moves the pixel
  const double t2 = theta * theta;
  const double distorted = theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
  const Eigen::Vector2d direction = p.head<2>() / r;
  J(0, 0) = distorted * direction.x();
  J(1, 1) = distorted * direction.y();
  double power = theta * t2;
  for (int i = 0; i < 4; ++i) {
    J(0, 4 + i) = fx * direction.x() * power;
    J(1, 4 + i) = fy * direction.y() * power;
    power *= t2;
  }
  return J;
}

CameraModel movedLens(const CameraModel& lens, const Eigen::Matrix<double, kLensParameters, 1>& step) {
  return {lens.kind(), lens.width(), lens.height(), lens.intrinsics() + step.head<4>(),
          lens.distortion() + step.tail<4>()};
}

}  // namespace swiftlet
