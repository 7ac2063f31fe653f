#pragma once
// Factor for a measured relative pose of two body states, from a loop closure between two keyframes.
//
// Residual, 6 x 1, order phi, p, whitened by a root A of the information (A^T A = information):
//   r = A [ Log(R(E)); p(E) ],   E = T_old_new_measured^-1 T_world_old^-1 T_world_new,
// so the information is that of a right perturbation of the measurement, T <- T (Exp(phi), p), in rad and m.
// Jacobians, 6 x 6, with respect to the pose parts of both error states (state.hpp: R <- R Exp(phi), p is
// added in the world). No allocation. Sources: docs/smoother.md; Barfoot, "State Estimation for Robotics",
// 2017, ch. 7.

#include <Eigen/Core>

#include "estimator/geometry/se3.hpp"
#include "estimator/smoother/state.hpp"

namespace swiftlet {

using Matrix6d = Eigen::Matrix<double, kPoseDim, kPoseDim>;
using Vector6d = Eigen::Matrix<double, kPoseDim, 1>;

struct RelativePoseFactor {
  Vector6d residual;
  Matrix6d jacobian_old;
  Matrix6d jacobian_new;
};

[[nodiscard]] RelativePoseFactor relativePoseFactor(const SE3& T_old_new_measured,
                                                    const Matrix6d& root_information, const SE3& T_world_old,
                                                    const SE3& T_world_new);

}  // namespace swiftlet
