#pragma once
// The part of a rotation about the world's z axis.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace swiftlet {

/// The rotation about z nearest to R in the Frobenius norm; R may be a sum of rotations.
inline Eigen::Quaterniond yawRotation(const Eigen::Matrix3d& R) {
  const double angle = std::atan2(R(1, 0) - R(0, 1), R(0, 0) + R(1, 1));
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
}

}  // namespace swiftlet
