#pragma once
// The error of a relative pose, its exact Jacobians, and the perturbation of a pose.
//
// Perturbation of a pose: T <- T (Exp(phi), rho), both in the body's frame, rotation first. With X =
// T_from^-1 T_to and T = T_from_to^-1 X the error is e = (2 vec(q(T)), p(T)) with q.w >= 0; in the plane
// (angle(T), p(T)). Then de/d(to) = J = diag(w I + [v]x, R(T)) (in the plane diag(1, R(T))) exactly, and
// de/d(from) = -J Ad(X^-1). docs/pose_graph.md section 2 derives both.
// Sources: Sola, Deray, Atchuthan, "A micro Lie theory", arXiv 1812.01537; Kummerle et al., "g2o", ICRA 2011.

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "estimator/geometry/so3.hpp"
#include "mapping/pose_graph/pose_graph.hpp"

namespace swiftlet {

template <typename Pose>
using PoseTangent = Eigen::Matrix<double, PoseSpace<Pose>::kDof, 1>;
template <typename Pose>
using PoseBlock = Eigen::Matrix<double, PoseSpace<Pose>::kDof, PoseSpace<Pose>::kDof>;

template <typename Pose>
struct EdgeLinearization {
  PoseTangent<Pose> error;
  PoseBlock<Pose> jacobian_to;
  PoseBlock<Pose> adjoint;  ///< Ad(X^-1): de/d(from) = -jacobian_to * adjoint
};

inline SE3 retracted(const SE3& T, const PoseTangent<SE3>& step) {
  return {T.rotation * expSo3(step.head<3>()), T.translation + T.rotation * step.tail<3>()};
}
inline SE2 retracted(const SE2& T, const PoseTangent<SE2>& step) {
  return {T.angle + step[0], T.translation + T.R() * step.tail<2>()};
}

/// Ad(X^-1) for tangents (rotation, translation): X^-1 (I + d) X = I + Ad(X^-1) d to first order.
inline PoseBlock<SE3> inverseAdjoint(const SE3& X) {
  const Eigen::Matrix3d R_t = X.R().transpose();
  PoseBlock<SE3> adjoint;
  adjoint.topLeftCorner<3, 3>() = R_t;
  adjoint.topRightCorner<3, 3>().setZero();
  adjoint.bottomLeftCorner<3, 3>().noalias() = -R_t * hat(X.translation);
  adjoint.bottomRightCorner<3, 3>() = R_t;
  return adjoint;
}
inline PoseBlock<SE2> inverseAdjoint(const SE2& X) {
  const Eigen::Matrix2d R_t = X.R().transpose();
  PoseBlock<SE2> adjoint = PoseBlock<SE2>::Zero();
  adjoint(0, 0) = 1;
  adjoint.block<2, 1>(1, 0) = R_t * Eigen::Vector2d(-X.translation.y(), X.translation.x());
  adjoint.bottomRightCorner<2, 2>() = R_t;
  return adjoint;
}

inline PoseTangent<SE3> relativeError(const SE3& measured, const SE3& from, const SE3& to) {
  const Eigen::Quaterniond q_to_inverse = to.rotation.conjugate();
  const Eigen::Quaterniond q = (q_to_inverse * from.rotation * measured.rotation).conjugate();
  const double sign = q.w() < 0 ? -2.0 : 2.0;
  PoseTangent<SE3> error;
  error.head<3>() = sign * q.vec();
  error.tail<3>() = measured.rotation.conjugate() *
                    (from.rotation.conjugate() * (to.translation - from.translation) - measured.translation);
  return error;
}
inline PoseTangent<SE2> relativeError(const SE2& measured, const SE2& from, const SE2& to) {
  PoseTangent<SE2> error;
  error[0] = wrapAngle(to.angle - from.angle - measured.angle);
  error.tail<2>() = measured.R().transpose() *
                    (from.R().transpose() * (to.translation - from.translation) - measured.translation);
  return error;
}

inline EdgeLinearization<SE3> linearized(const SE3& measured, const SE3& from, const SE3& to) {
  EdgeLinearization<SE3> out;
  const SE3 X = from.inverse() * to;
  const SE3 T = measured.inverse() * X;
  const double sign = T.rotation.w() < 0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * T.rotation.vec();
  out.error.head<3>() = 2.0 * v;
  out.error.tail<3>() = T.translation;
  out.jacobian_to.setZero();
  out.jacobian_to.topLeftCorner<3, 3>() = hat(v);
  out.jacobian_to.topLeftCorner<3, 3>().diagonal().array() += sign * T.rotation.w();
  out.jacobian_to.bottomRightCorner<3, 3>() = T.R();
  out.adjoint = inverseAdjoint(X);
  return out;
}
inline EdgeLinearization<SE2> linearized(const SE2& measured, const SE2& from, const SE2& to) {
  EdgeLinearization<SE2> out;
  const SE2 X = from.inverse() * to;
  const SE2 T = measured.inverse() * X;
  out.error << T.angle, T.translation;
  out.jacobian_to.setZero();
  out.jacobian_to(0, 0) = 1;
  out.jacobian_to.bottomRightCorner<2, 2>() = T.R();
  out.adjoint = inverseAdjoint(X);
  return out;
}

/// 1/2 e^T Omega e.
template <typename Pose>
double edgeCost(const RelativePose<Pose>& edge, const Pose& from, const Pose& to) {
  const PoseTangent<Pose> e = relativeError(edge.T_from_to, from, to);
  return 0.5 * e.dot(edge.information * e);
}

/// Sum of the edges' costs: g2o's chi2 / 2.
template <typename Pose>
double graphCost(const PoseGraph<Pose>& graph) {
  double cost = 0;
  for (const RelativePose<Pose>& edge : graph.edges) {
    cost += edgeCost(edge, graph.poses[edge.from], graph.poses[edge.to]);
  }
  return cost;
}

}  // namespace swiftlet
