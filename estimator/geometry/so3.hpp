#pragma once
// Rotations: exponential map, logarithm and right Jacobians of SO(3).
//
// Convention: right perturbation, R <- R Exp(phi), phi in radians in the rotated (body) frame.
// Source: Sola, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics",
// arXiv 1812.01537, equations 132-146; Forster et al., T-RO 2017, equations 3-8.

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace swiftlet {

/// The matrix with hat(a) b = a x b.
inline Eigen::Matrix3d hat(const Eigen::Vector3d& a) {
  Eigen::Matrix3d m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

/// Exp: rotation vector [rad] to unit quaternion. Exact to rounding at any angle.
Eigen::Quaterniond expSo3(const Eigen::Vector3d& phi);

/// Exp as a rotation matrix.
Eigen::Matrix3d expSo3Matrix(const Eigen::Vector3d& phi);

/// Log: unit quaternion of either sign to the rotation vector with |phi| <= pi.
Eigen::Vector3d logSo3(const Eigen::Quaterniond& q);

/// Log of a rotation matrix.
Eigen::Vector3d logSo3(const Eigen::Matrix3d& R);

/// Jr with Exp(phi + d) = Exp(phi) Exp(Jr(phi) d) to first order.
Eigen::Matrix3d rightJacobianSo3(const Eigen::Vector3d& phi);

/// Inverse of Jr: Log(Exp(phi) Exp(d)) = phi + JrInv(phi) d. Valid for |phi| < 2 pi.
Eigen::Matrix3d rightJacobianInverseSo3(const Eigen::Vector3d& phi);

}  // namespace swiftlet
