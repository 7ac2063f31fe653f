#include "estimator/smoother/extra_states.hpp"

#include <cmath>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

// Below this angle [rad] the ratio angle / sine is 1 to double precision.
constexpr double kSmallAngle = 1e-8;

}  // namespace

Plane::Plane(const Eigen::Vector3d& normal, double distance)
    : rotation_(Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), normal).normalized()),
      distance_(distance) {}

// The rotation vector (-b, a, 0) in the plane's axes moves its z axis by (a, b, 0).
void Plane::retract(const Eigen::Vector3d& delta) {
  rotation_ = (rotation_ * expSo3(Eigen::Vector3d(-delta[1], delta[0], 0))).normalized();
  distance_ += delta[2];
}

Eigen::Vector3d Plane::minus(const Plane& reference) const {
  const Eigen::Vector3d n = reference.rotation_.conjugate() * normal();
  const double sine = n.head<2>().norm();
  const double angle = std::atan2(sine, n.z());
  const double step = distance_ - reference.distance_;
  if (sine > kSmallAngle) return {angle / sine * n.x(), angle / sine * n.y(), step};
  return n.z() > 0 ? Eigen::Vector3d(n.x(), n.y(), step) : Eigen::Vector3d(angle, 0, step);
}

void ExtraState::retract(const Eigen::Vector3d& delta) {
  if (isLandmark()) {
    x.point += delta;
  } else {
    x.plane.retract(delta);
  }
}

Eigen::Vector3d ExtraState::deviation() const {
  return isLandmark() ? Eigen::Vector3d(x.point - reference.point) : x.plane.minus(reference.plane);
}

void ExtraState::enterPrior() {
  in_prior = true;
  reference = x;
}

}  // namespace swiftlet
