#pragma once
// The projective map of a plane that fits point pairs best.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>

namespace swiftlet {

struct PointPair {
  Eigen::Vector2d from = Eigen::Vector2d::Zero();
  Eigen::Vector2d to = Eigen::Vector2d::Zero();
};

/// Needs at least four pairs. False: points are collinear or not finite.
/// Source: Hartley, Zisserman, Multiple View Geometry, 2004, algorithm 4.2 (normalized DLT).
[[nodiscard]] bool fitHomography(std::span<const PointPair> pairs, Eigen::Matrix3d& H);

[[nodiscard]] inline Eigen::Vector2d mapPoint(const Eigen::Matrix3d& H, const Eigen::Vector2d& point) {
  return (H * point.homogeneous()).hnormalized();
}

}  // namespace swiftlet
