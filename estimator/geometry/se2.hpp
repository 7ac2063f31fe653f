#pragma once
// Rigid transforms in the plane, named and chained like SE3: T_A_B takes coordinates in B to coordinates in
// A.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace swiftlet {

/// The equivalent angle in [-pi, pi].
inline double wrapAngle(double angle) { return std::remainder(angle, 2 * M_PI); }

struct SE2 {
  double angle = 0;                                       ///< rad, in [-pi, pi]
  Eigen::Vector2d translation = Eigen::Vector2d::Zero();  ///< metres

  SE2() = default;
  SE2(double theta, const Eigen::Vector2d& p) : angle(wrapAngle(theta)), translation(p) {}

  [[nodiscard]] Eigen::Matrix2d R() const { return Eigen::Rotation2Dd(angle).toRotationMatrix(); }
  [[nodiscard]] SE2 inverse() const { return {-angle, -(R().transpose() * translation)}; }
  SE2 operator*(const SE2& other) const {
    return {angle + other.angle, translation + R() * other.translation};
  }
  Eigen::Vector2d operator*(const Eigen::Vector2d& p) const { return R() * p + translation; }
};

}  // namespace swiftlet
