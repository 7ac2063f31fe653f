#include "mapping/pose_graph/gravity_factor.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace swiftlet {
namespace {

/// Two axes across `up`.
Eigen::Matrix<double, 3, 2> across(const Eigen::Vector3d& up) {
  Eigen::Matrix<double, 3, 2> axes;
  axes.col(0) = up.unitOrthogonal();
  axes.col(1) = up.cross(axes.col(0));
  return axes;
}

}  // namespace

GravityFactor gravityFactor(const Tilt& tilt) {
  GravityFactor factor;
  if (!tilt.known()) return factor;
  const Eigen::Matrix<double, 3, 2> axes = across(tilt.up_body);
  const Eigen::Matrix2d P = axes.transpose() * tilt.covariance * axes;
  factor.up_body = tilt.up_body;
  factor.information = axes * P.inverse() * axes.transpose();
  return factor.information.allFinite() ? factor : GravityFactor{};
}

GravityFactor gravityFactor(const Tilt& tilt, const Tilt& previous, const Eigen::Matrix3d& R_previous_this,
                            const Eigen::Matrix3d& Q) {
  if (!tilt.known() || !previous.known()) return gravityFactor(tilt);
  GravityFactor factor = gravityFactor(tilt);
  if (factor.information.isZero()) return factor;
  const Eigen::Matrix<double, 3, 2> axes = across(tilt.up_body);
  const Eigen::Matrix3d said = R_previous_this.transpose() * previous.covariance * R_previous_this + Q;
  const Eigen::Matrix2d P = axes.transpose() * tilt.covariance * axes;
  const Eigen::Matrix2d before = axes.transpose() * said * axes;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> learned(P.inverse() - before.inverse());
  const Eigen::Vector2d values = learned.eigenvalues().cwiseMax(0);
  const Eigen::Matrix<double, 3, 2> directions = axes * learned.eigenvectors();
  factor.information = directions * values.asDiagonal() * directions.transpose();
  return factor.information.allFinite() ? factor : GravityFactor{};
}

}  // namespace swiftlet
