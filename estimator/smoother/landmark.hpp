#pragma once
// A landmark of the window: its observations, and its point as last triangulated.
//
// The point is stored as p = reference + bearing / inverse_depth with a constant reference (a former camera
// centre), so that points at infinity are regular (inverse_depth = 0) and no state is its anchor. In camera i
// its homogeneous ray is
//   h = R_cam_world (bearing + inverse_depth (reference - center_i)),
// and the residual of an observation with measured unit bearing m is
//   r = W h / (m . h),   W = d pixel / d ray at m, divided by the pixel noise   (2 x 3, W m = 0):
// the reprojection error in units of sigma, to first order in the error, for any lens, also beyond 90
// degrees, without evaluating the lens model in the solver. With a rolling shutter m and W are rotated to the
// axes of the image's middle row (RowMotion), and center_i is the camera's position at the row of the
// observation. Memory: 2.3 kB per landmark of the window. Equations and Jacobians: docs/smoother.md.

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "estimator/camera/camera_model.hpp"
#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/smoother/extra_states.hpp"

namespace swiftlet {

/// In single precision, accurate to 1e-4 px, which halves the memory traffic of a solve.
struct CameraSighting {
  bool used = false;
  Eigen::Vector3f bearing = Eigen::Vector3f::Zero();  ///< m, unit, camera frame
  /// W, 1 / (unit ray): pixels per unit of ray, divided by the pixel noise.
  Eigen::Matrix<float, 2, 3> weight = Eigen::Matrix<float, 2, 3>::Zero();
  float row = 0;  ///< row of the image, from -0.5 (first) to 0.5 (last)

  static CameraSighting of(const Eigen::Vector3d& ray, const Matrix23d& whitening) {
    return {true, ray.cast<float>(), whitening.cast<float>()};
  }
  [[nodiscard]] Eigen::Vector3d ray() const { return bearing.cast<double>(); }
  [[nodiscard]] Matrix23d whitening() const { return weight.cast<double>(); }
};

/// Observation of a landmark by one state.
struct Sighting {
  std::uint32_t slot = 0;  ///< of the state (fixed lag), or index of the keyframe (full smoothing)
  std::array<CameraSighting, kMaxCameras> camera;

  [[nodiscard]] bool any() const { return camera[0].used || camera[1].used; }
};

/// Position of a landmark, as last triangulated.
struct LandmarkPoint {
  bool triangulated = false;
  Eigen::Vector3d reference = Eigen::Vector3d::Zero();  ///< m, world
  Eigen::Vector3d bearing = Eigen::Vector3d::UnitZ();   ///< unit, world axes
  double inverse_depth = 0;                             ///< 1/m, >= 0
  double inverse_depth_sigma = 0;                       ///< 1/m

  /// Position [m, world]. Not for a point at infinity (inverse_depth = 0).
  [[nodiscard]] Eigen::Vector3d position() const { return reference + bearing / inverse_depth; }
};

/// A landmark of the fixed-lag window.
struct Landmark {
  TrackId id = 0;
  std::uint64_t last_frame = 0;  ///< index of the newest frame that saw it
  int frames_seen = 0;
  int rejections = 0;             ///< number of solves in which it did not fit
  bool in_system = false;         ///< used in the current solve
  double mean_square = 0;         ///< of its whitened residuals after the last solve
  std::uint8_t extra = kNoExtra;  ///< index of its extra state; kNoExtra: structureless
  LandmarkPoint point;
  FixedVector<Sighting, kMaxStates> sightings;

  [[nodiscard]] std::span<const Sighting> views() const { return {sightings.data(), sightings.size()}; }
  /// Whether it was in the last solve and fitted.
  [[nodiscard]] bool accepted() const { return in_system && point.triangulated; }
  [[nodiscard]] bool seenFrom(std::uint32_t slot) const {
    return std::ranges::find(sightings, slot, &Sighting::slot) != sightings.end();
  }
  /// Number of observations, counted per camera.
  [[nodiscard]] int viewCount() const {
    int count = 0;
    for (const Sighting& s : sightings) count += int{s.camera[0].used} + int{s.camera[1].used};
    return count;
  }
};

}  // namespace swiftlet
