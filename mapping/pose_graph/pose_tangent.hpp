#pragma once
// Small motions of poses of the plane and of space, rotation first, then translation (rad, m), on the right:
// T <- T Exp(xi). What the code of loop selection is templated with.
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

/// How far T is from the identity, as the cost of a pose graph counts it (pose_graph.hpp): to first order xi
/// of T = Exp(xi).
inline PoseVector<SE2> poseError(const SE2& T) { return {T.angle, T.translation.x(), T.translation.y()}; }
inline PoseVector<SE3> poseError(const SE3& T) {
  PoseVector<SE3> error;
  error << (T.rotation.w() < 0 ? -2 : 2) * T.rotation.vec(), T.translation;
  return error;
}

/// A pose near the identity with poseError(T) = xi to first order; the inverse of poseError in the plane.
inline SE2 poseFromTangent(const PoseVector<SE2>& xi) { return {xi[0], xi.tail<2>()}; }
inline SE3 poseFromTangent(const PoseVector<SE3>& xi) {
  return {expSo3(Eigen::Vector3d(xi.head<3>())), Eigen::Vector3d(xi.tail<3>())};
}

inline bool allFinite(const SE2& T) { return std::isfinite(T.angle) && T.translation.allFinite(); }
inline bool allFinite(const SE3& T) { return T.rotation.coeffs().allFinite() && T.translation.allFinite(); }

}  // namespace swiftlet
