#pragma once
// Relative pose of two views of the same points, from bearings and inverse depths of both, with its
// covariance.
//
// A point is a direction and an inverse distance in the old view (3 unknowns); each view says its bearing
// (2 residuals each) and, where it knows, its inverse distance (1 each). The points are eliminated (Schur),
// the pose is stepped by Gauss-Newton with Huber weights. A match counts 1 (no depth: the epipolar
// constraint), 2 (one depth) or 3 (both) degrees of freedom. Nothing is singular for points far away.
//
// Tangent: T_old_new <- T_old_new (Exp(phi), delta): rotation first [rad], translation [m] in the axes of the
// new view. That is the error of an edge `from` old `to` new in mapping/pose_graph.
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

/// What one view says of a point.
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
  double chi_squared = 0;                            ///< of its residuals at their least
  bool used = true;                                  ///< the refinement reads it; false: left out

  [[nodiscard]] int dof() const {
    return 1 + static_cast<int>(old_view.hasDepth()) + static_cast<int>(new_view.hasDepth());
  }
};

/// Chi-square over `points` that 0.27 % of true matches exceed (3 sigma), for 1, 2 or 3 degrees of freedom.
double matchGate(int dof);

struct RelativePoseSettings {
  int steps = 8;            ///< Gauss-Newton, at most
  double huber = 2.0;       ///< residuals beyond this many sigma (per match) pull with constant force
  double converged = 1e-5;  ///< steps shorter than this [rad, m] are the last
};

struct RelativePoseFit {
  Matrix6d information = Matrix6d::Zero();  ///< of the set noise, robust weights in; (rotation, translation)
  double chi_squared = 0;                   ///< weighted, over the used matches
  double dof = 0;                           ///< weighted, minus 6
  int steps = 0;
  std::size_t used = 0;
};

/// Puts each point where its views together say, given `T_old_new`; sets its state and chi-square. Points
/// that come out behind a view get an infinite chi-square.
void placePoints(const SE3& T_old_new, std::span<MatchedPoint> points);

/// Steps `T_old_new` to its best over the used points (placed by the call). kDegenerate: fewer than 6 degrees
/// of freedom or a singular system; `T_old_new` is then unchanged. kNumerical: not finite.
Status refineRelativePose(const RelativePoseSettings& settings, std::span<MatchedPoint> points,
                          SE3& T_old_new, RelativePoseFit& fit);

/// How far a pose moves when a few matches beside each other are left out: what one thing of the scene, taken
/// for another, may have done to it unseen.
struct RelativePoseSupport {
  double rotation_shift = 0;     ///< rad, the largest found
  double translation_shift = 0;  ///< m
};

inline constexpr std::size_t kSupportSeeds = 16;
/// Looks at the kSupportSeeds used matches of the greatest leverage (Hoaglin, Welsch, "The Hat Matrix in
/// Regression and ANOVA", 1978), each with the used ones whose bearings lie within `reach` [rad] of its own
/// in both views. To first order about `T_old_new`, where `points` were refined; infinite where the others do
/// not determine the pose. Costs about two steps of the refinement.
RelativePoseSupport relativePoseSupport(const RelativePoseSettings& settings,
                                        std::span<const MatchedPoint> points, const SE3& T_old_new,
                                        double reach);

/// Information or covariance of `T_a_b` in the tangent above, carried to T_x_a T_a_b T_x_b^-1 with both X
/// equal: camera to body. `T_body_cam` is X; covariance in, covariance out.
Matrix6d covarianceOfBody(const SE3& T_body_cam, const Matrix6d& covariance_of_cameras);

}  // namespace swiftlet
