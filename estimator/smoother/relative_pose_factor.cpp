#include "estimator/smoother/relative_pose_factor.hpp"

#include "estimator/geometry/so3.hpp"

namespace swiftlet {

RelativePoseFactor relativePoseFactor(const SE3& T_old_new_measured, const Matrix6d& root_information,
                                      const SE3& T_world_old, const SE3& T_world_new) {
  const SE3 T_old_new = T_world_old.inverse() * T_world_new;
  const SE3 error = T_old_new_measured.inverse() * T_old_new;
  const Eigen::Vector3d phi = logSo3(error.rotation);
  const Eigen::Matrix3d J_inverse = rightJacobianInverseSo3(phi);
  const Eigen::Matrix3d R_measured_old = T_old_new_measured.R().transpose();
  const Eigen::Matrix3d R_measured_world = R_measured_old * T_world_old.R().transpose();
  RelativePoseFactor factor;
  factor.residual << phi, error.translation;
  factor.residual = root_information * factor.residual;
  Matrix6d J = Matrix6d::Zero();
  J.block<3, 3>(0, 0) = -J_inverse * T_old_new.R().transpose();
  J.block<3, 3>(3, 0) = R_measured_old * hat(T_old_new.translation);
  J.block<3, 3>(3, 3) = -R_measured_world;
  factor.jacobian_old = root_information * J;
  J.setZero();
  J.block<3, 3>(0, 0) = J_inverse;
  J.block<3, 3>(3, 3) = R_measured_world;
  factor.jacobian_new = root_information * J;
  return factor;
}

}  // namespace swiftlet
