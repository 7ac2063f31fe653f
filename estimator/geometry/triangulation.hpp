#pragma once
// Triangulates a point from n >= 2 bearings at known poses, with measures of its quality.
//
// Initial point: homogeneous DLT on unit bearings, (I - b b^T) (R^T (x - c)) = 0 stacked (Hartley, Zisserman,
// "Multiple View Geometry", section 12.2, written for bearings), in coordinates centred and scaled by the
// camera centres. It is not singular at infinity, so points behind the cameras are distinguished from points
// far ahead. Then Gauss-Newton on the angular errors.
// Any lens, any angle. No allocation, no bound on n; O(n) per pass. About 2 us for two views.

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "estimator/geometry/se3.hpp"

namespace swiftlet {

enum class TriangulationState : std::uint8_t {
  kValid,
  kInvalidInput,  ///< fewer than two views, sizes differ, NaN
  kNoParallax,    ///< the rays are parallel within their noise; depth is not determined
  kBehind,        ///< in front of one camera and behind another, or behind all
  kTooNear,
  kTooFar,
  kOutlier,  ///< one of the bearings misses the point by more than max_error
};

struct TriangulationSettings {
  double min_parallax = 0.002;  ///< [rad] largest angle between two rays; 1 px at 450 px focal length
  double min_depth = 0.1;       ///< [m] distance to the nearest camera
  double max_depth = 200.0;     ///< [m] distance to the first camera
  double max_error = 0.01;      ///< [rad] largest error of a bearing; 4.5 px at 450 px focal length
  double max_condition = 1e7;  ///< of the information matrix; its square root is longest axis / shortest axis
  int refine_steps = 3;        ///< Gauss-Newton steps; 0: only DLT
};

/// Known values are set for every state except kInvalidInput. `point` is only valid for kValid, kTooNear,
/// kTooFar and kOutlier.
struct Triangulation {
  TriangulationState state = TriangulationState::kInvalidInput;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();        ///< world [m]
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< world [1/m^2] for bearings of 1 rad noise
  double parallax = 0;                                    ///< [rad]
  double condition = 0;                                   ///< of `information`
  double max_error = 0;                                   ///< [rad]

  [[nodiscard]] bool valid() const { return state == TriangulationState::kValid; }
};

/// `bearings[i]`: unit, in camera i. `T_world_cam[i]`: pose of camera i.
Triangulation triangulate(std::span<const Eigen::Vector3d> bearings, std::span<const SE3> T_world_cam,
                          const TriangulationSettings& settings = {});

}  // namespace swiftlet
