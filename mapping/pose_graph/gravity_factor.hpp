#pragma once
// What a pose knows of the vertical, as a factor of the pose graph.
//
// The odometry's tilt does not drift: the accelerometer sees gravity. Its errors last, so poses are no
// independent witnesses: with P the covariance of the tilt as the odometry has it, and Q that of the relative
// rotation from the pose before, the relative pose has already said all but
//   Lambda = P_k^-1 - (P_k-1 + Q_k)^-1      (in the axes of pose k, across the vertical),
// what the accelerometer added between the two. A filter along the chain then has the covariance P_k at each
// pose; a pose that learned nothing gets nothing. The first of a component gets P^-1.
//
// Error: e = (R^T z) x up, with R of T_map_body and z = (0, 0, 1): to first order the tilt [rad], whatever
// the heading. Cost 1/2 e^T Lambda e. de/dphi = -[up]x [R^T z]x for R <- R Exp(phi).

#include <Eigen/Core>

#include "mapping/pose_graph/pose_graph.hpp"

namespace swiftlet {

/// The odometry's attitude at a pose.
struct Tilt {
  Eigen::Vector3d up_body = Eigen::Vector3d::UnitZ();    ///< unit
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< rad^2, R <- R Exp(phi); 0: not known
  [[nodiscard]] bool known() const {
    return covariance.trace() > 0 && covariance.allFinite() && up_body.allFinite();
  }
};

/// Of a pose with `tilt`; `previous`, the pose before, is R_previous_this away with covariance Q (rad^2, in
/// the axes of this pose). Without information where the tilt is not known, not better than from there, or
/// its covariance is no covariance.
GravityFactor gravityFactor(const Tilt& tilt, const Tilt& previous, const Eigen::Matrix3d& R_previous_this,
                            const Eigen::Matrix3d& Q);
/// Of the first pose of a component.
GravityFactor gravityFactor(const Tilt& tilt);

}  // namespace swiftlet
