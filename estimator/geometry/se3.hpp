#pragma once
// Rigid transforms. `T_A_B` takes coordinates in B to coordinates in A: p_A = T_A_B * p_B, and
// chains read by cancelling neighbours: T_W_C = T_W_B * T_B_C.

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace swiftlet {

struct SE3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  ///< unit, Hamilton
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();         ///< metres

  SE3() = default;
  SE3(const Eigen::Quaterniond& q, const Eigen::Vector3d& p) : rotation(q.normalized()), translation(p) {}
  SE3(const Eigen::Matrix3d& R, const Eigen::Vector3d& p)
      : rotation(Eigen::Quaterniond(R).normalized()), translation(p) {}

  [[nodiscard]] Eigen::Matrix3d R() const { return rotation.toRotationMatrix(); }
  [[nodiscard]] SE3 inverse() const {
    const Eigen::Quaterniond q = rotation.conjugate();
    return {q, -(q * translation)};
  }
  SE3 operator*(const SE3& other) const {
    return {rotation * other.rotation, translation + rotation * other.translation};
  }
  Eigen::Vector3d operator*(const Eigen::Vector3d& p) const { return rotation * p + translation; }
};

}  // namespace swiftlet
