#pragma once
// Relative pose of two views of the same points, from bearings and inverse depths of both, with its
// covariance.
//
// A point is a direction and an inverse distance in the old view (3 unknowns). Each view measures its bearing
// (2 residuals) and, if known, its inverse distance (1 residual). Points are eliminated (Schur), and the pose
// is found by Gauss-Newton with Huber weights. A match counts 1 (no depth: the epipolar constraint), 2 (one
// depth) or 3 (both) degrees of freedom. Points at infinity are not singular.
//
// Tangent: T_old_new <- T_old_new (Exp(phi), delta), rotation first [rad], translation [m] in the axes of the
// new view, as for an edge `from` old `to` new in mapping/pose_graph.
//
// No allocation; 0.25 us per match and step. Sources: Triggs et al., "Bundle Adjustment", 1999 (elimination,
// covariance); Huber, "Robust Statistics" (weights). Equations: docs/place.md.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>

#include "estimator/core/status.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// A point as measured in one view.
struct PointView {
  Eigen::Vector3d bearing = Eigen::Vector3d::UnitZ();  ///< unit, in the view's camera
  double bearing_sigma = 0;                            ///< rad, 1 sigma per axis, > 0
  double inverse_depth = 0;                            ///< 1/m, 1 / distance
  double inverse_depth_sigma = 0;                      ///< 1/m; 0: the depth is unknown

  [[nodiscard]] bool hasDepth() const { return inverse_depth_sigma > 0; }
};

struct MatchedPoint {
  PointView old_view, new_view;
  // State of the refinement, set by it.
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();  ///< of the old bearing, in its tangent plane
  double inverse_depth = 0;                          ///< 1/m, in the old view
  double chi_squared = 0;                            ///< of its residuals, minimized
  bool used = true;                                  ///< input of the refinement; false: left out

  [[nodiscard]] int dof() const {
    return 1 + static_cast<int>(old_view.hasDepth()) + static_cast<int>(new_view.hasDepth());
  }
};

/// Chi-square that 0.27 % of true matches exceed (3 sigma), for 1, 2 or 3 degrees of freedom.
double matchGate(int dof);

struct RelativePoseSettings {
  int steps = 8;            ///< largest number of Gauss-Newton steps
  double huber = 2.0;       ///< sigmas; residuals of a match beyond this are weighted down
  double converged = 1e-5;  ///< stops at steps shorter than this [rad, m]
};

struct RelativePoseFit {
  Matrix6d information =
      Matrix6d::Zero();    ///< of the configured noise, robust weights included; rotation first
  double chi_squared = 0;  ///< weighted, over the used matches
  double dof = 0;          ///< weighted, minus 6
  int steps = 0;
  std::size_t used = 0;
};

/// Estimates each point from both its views, given `T_old_new`; sets its state and chi-square. Points behind
/// a view get an infinite chi-square.
void placePoints(const SE3& T_old_new, std::span<MatchedPoint> points);

/// Optimizes `T_old_new` over the used points, and the points with it. kDegenerate: fewer than 6 degrees of
/// freedom or a singular system; `T_old_new` is then unchanged. kNumerical: not finite.
Status refineRelativePose(const RelativePoseSettings& settings, std::span<MatchedPoint> points,
                          SE3& T_old_new, RelativePoseFit& fit);

/// How far a pose moves if a few neighbouring matches are left out. Detects poses turned by one object of the
/// scene that was mistaken for another.
struct RelativePoseSupport {
  double rotation_shift = 0;     ///< rad, the largest found
  double translation_shift = 0;  ///< m
};

inline constexpr std::size_t kSupportSeeds = 16;
/// Tests the kSupportSeeds used matches of greatest leverage (Hoaglin, Welsch, "The Hat Matrix in Regression
/// and ANOVA", 1978), each together with the used ones whose bearings are within `reach` [rad] of its own in
/// both views. First order about `T_old_new`, at which `points` were refined. Infinite if the remaining
/// matches do not determine the pose. Costs about two steps of the refinement.
RelativePoseSupport relativePoseSupport(const RelativePoseSettings& settings,
                                        std::span<const MatchedPoint> points, const SE3& T_old_new,
                                        double reach);

/// Covariance of a relative pose of two cameras, transformed to that of their bodies (tangent as above):
/// T_body_cam T_a_b T_body_cam^-1.
Matrix6d covarianceOfBody(const SE3& T_body_cam, const Matrix6d& covariance_of_cameras);

}  // namespace swiftlet
