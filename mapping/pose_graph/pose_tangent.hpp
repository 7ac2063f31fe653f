#pragma once
// Tangent space of poses in the plane and in space, perturbed on the right: T <- T Exp(xi), rotation first,
// then translation (rad, m). Loop selection is templated with it.
//
// Source: Sola, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics", arXiv 1812.01537,
// equations 156 (plane) and 175 (space), with rotation and translation exchanged.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "estimator/geometry/se2.hpp"
#include "estimator/geometry/se3.hpp"
#include "estimator/geometry/so3.hpp"
#include "mapping/pose_graph/pose_graph.hpp"

namespace swiftlet {

template <typename Pose>
using PoseVector = Eigen::Matrix<double, PoseSpace<Pose>::kDof, 1>;
template <typename Pose>
using PoseMatrix = Eigen::Matrix<double, PoseSpace<Pose>::kDof, PoseSpace<Pose>::kDof>;

/// Ad(T) with T Exp(xi) T^-1 = Exp(Ad(T) xi).
inline PoseMatrix<SE2> poseAdjoint(const SE2& T) {
  PoseMatrix<SE2> adjoint = PoseMatrix<SE2>::Zero();
  adjoint(0, 0) = 1;
  adjoint.bottomLeftCorner<2, 1>() << T.translation.y(), -T.translation.x();
  adjoint.bottomRightCorner<2, 2>() = T.R();
  return adjoint;
}
inline PoseMatrix<SE3> poseAdjoint(const SE3& T) {
  const Eigen::Matrix3d R = T.R();
  PoseMatrix<SE3> adjoint = PoseMatrix<SE3>::Zero();
  adjoint.topLeftCorner<3, 3>() = R;
  adjoint.bottomLeftCorner<3, 3>() = hat(T.translation) * R;
  adjoint.bottomRightCorner<3, 3>() = R;
  return adjoint;
}

/// xi with T = Exp(xi). On long chains errors in these coordinates stay close to normal, while those in
/// (rotation, translation) bend with the heading (Long, Wolfe, Mashner, Chirikjian, "The banana distribution
/// is Gaussian", RSS 2012). To first order they equal the error of the graph's cost (pose_graph.hpp).
inline PoseVector<SE2> poseLog(const SE2& T) {
  const double half = 0.5 * T.angle;
  // For small angles the next term of the series is below rounding.
  const double along = std::abs(half) < 1e-4 ? 1 - half * half / 3 : half / std::tan(half);
  const Eigen::Vector2d& p = T.translation;
  return {T.angle, along * p.x() + half * p.y(), along * p.y() - half * p.x()};
}
inline PoseVector<SE3> poseLog(const SE3& T) {
  const Eigen::Vector3d phi = logSo3(T.rotation);
  PoseVector<SE3> xi;
  // The inverse left Jacobian is the inverse right one of the opposite rotation.
  xi << phi, rightJacobianInverseSo3(-phi) * T.translation;
  return xi;
}

/// T = Exp(xi).
inline SE2 poseExp(const PoseVector<SE2>& xi) {
  const double half = 0.5 * xi[0];
  const double sinc = std::abs(half) < 1e-4 ? 1 - half * half / 6 : std::sin(half) / half;
  return {xi[0], sinc * (Eigen::Rotation2Dd(half) * Eigen::Vector2d(xi.tail<2>()))};
}
inline SE3 poseExp(const PoseVector<SE3>& xi) {
  const Eigen::Vector3d phi = xi.head<3>();
  const Eigen::Matrix3d left = rightJacobianInverseSo3(-phi).inverse();
  return {expSo3(phi), left * xi.tail<3>()};
}

inline bool allFinite(const SE2& T) { return std::isfinite(T.angle) && T.translation.allFinite(); }
inline bool allFinite(const SE3& T) { return T.rotation.coeffs().allFinite() && T.translation.allFinite(); }

}  // namespace swiftlet
