#include "estimator/geometry/minimal_solvers.hpp"

#include <Eigen/Geometry>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

// If the angle between two epipolar planes [rad] or a parallax is below this, the direction is undetermined.
constexpr double kMinSine = 1e-9;

// Right-handed axes: the first bearing, the normal of both, and their cross product.
Eigen::Matrix3d axesOf(const Eigen::Vector3d& first, const Eigen::Vector3d& second) {
  Eigen::Matrix3d axes;
  axes.col(0) = first;
  axes.col(1) = first.cross(second) / first.cross(second).norm();
  axes.col(2) = axes.col(0).cross(axes.col(1));
  return axes;
}

}  // namespace

EssentialMotions motionsOfEssential(const Eigen::Matrix3d& E) {
  // Columns of E are t x (columns of R): t is orthogonal to all of them.
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d candidate = E.col(i).cross(E.col((i + 1) % 3));
    if (candidate.squaredNorm() > t.squaredNorm()) t = candidate;
  }
  EssentialMotions motions;
  motions.t = t.squaredNorm() > 0 ? Eigen::Vector3d(t.normalized()) : Eigen::Vector3d::UnitX();
  Eigen::Matrix3d cofactors;
  for (int i = 0; i < 3; ++i) cofactors.col(i) = E.col((i + 1) % 3).cross(E.col((i + 2) % 3));
  // With |t| = 1: cofactors(E) = t t^T R and hat(t) E = (t t^T - I) R.
  const Eigen::Matrix3d turned = hat(motions.t) * E;
  for (std::size_t i = 0; i < 2; ++i) {
    const Eigen::Matrix3d R = cofactors + (i == 0 ? -turned : turned);
    motions.R[i] = Eigen::Quaterniond(R).normalized().toRotationMatrix();
  }
  return motions;
}

Eigen::Matrix3d rotationFromTwoPoints(std::span<const Eigen::Vector3d, 2> prev,
                                      std::span<const Eigen::Vector3d, 2> cur) {
  return axesOf(cur[0], cur[1]) * axesOf(prev[0], prev[1]).transpose();
}

Eigen::Vector3d translationFromTwoPoints(const Eigen::Matrix3d& R, std::span<const Eigen::Vector3d, 2> prev,
                                         std::span<const Eigen::Vector3d, 2> cur) {
  // The translation lies in both epipolar planes.
  const Eigen::Vector3d turned0 = R * prev[0];
  const Eigen::Vector3d turned1 = R * prev[1];
  const Eigen::Vector3d normal0 = turned0.cross(cur[0]);
  const Eigen::Vector3d normal1 = turned1.cross(cur[1]);
  const Eigen::Vector3d t = normal0.cross(normal1);
  const double norm = t.norm();
  if (!(norm > kMinSine * normal0.norm() * normal1.norm()) || !(norm > 0)) return Eigen::Vector3d::Zero();
  // For points in front, the current bearing lies between the rotated one and t: it moved towards t.
  const double towards = (cur[0] - turned0).dot(t) + (cur[1] - turned1).dot(t);
  return towards < 0 ? Eigen::Vector3d(-t / norm) : Eigen::Vector3d(t / norm);
}

}  // namespace swiftlet
