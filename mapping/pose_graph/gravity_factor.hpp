#pragma once
// The tilt of the odometry as a factor of the pose graph.
//
// The odometry's tilt does not drift, because the accelerometer measures gravity. Its errors last for
// seconds, so poses are not independent measurements. With P the covariance of the odometry's tilt and Q that
// of the relative rotation from the pose before, which the odometry edge already counts, the factor holds
// what the accelerometer added between the two:
//   Lambda = P_k^-1 - (P_k-1 + Q_k)^-1      (in the axes of pose k, across the vertical).
// A filter along the chain then has the covariance P_k at each pose. A pose without new information gets no
// factor, the first of a component gets P^-1.
//
// Error: e = (R^T z) x up, with R of T_map_body and z = (0, 0, 1); to first order the tilt [rad], independent
// of the heading. Cost 1/2 e^T Lambda e. de/dphi = -[up]x [R^T z]x for R <- R Exp(phi).

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

/// Factor of a pose with `tilt`. The pose before has the tilt `previous` and is R_previous_this away with
/// covariance Q (rad^2, in the axes of this pose). Zero information if the tilt is unknown, adds nothing to
/// that of the pose before, or its covariance is invalid.
GravityFactor gravityFactor(const Tilt& tilt, const Tilt& previous, const Eigen::Matrix3d& R_previous_this,
                            const Eigen::Matrix3d& Q);
/// Factor of the first pose of a component.
GravityFactor gravityFactor(const Tilt& tilt);

}  // namespace swiftlet
