#pragma once
// A verified loop closure for full smoothing: two keyframes, their measured relative pose, and pairs of
// features that observe the same point.

#include <Eigen/Core>
#include <array>
#include <vector>

#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

/// A feature of a keyframe: a track of the odometry in that keyframe's epoch, its pixels in the cameras, or
/// both.
struct RevisitFeature {
  bool has_track = false;
  TrackId track = 0;
  std::array<bool, kMaxCameras> seen{};
  std::array<Eigen::Vector2f, kMaxCameras> pixel{};  ///< distorted, valid where seen
};

struct RevisitMatch {
  RevisitFeature old_feature;
  RevisitFeature new_feature;
};

struct LoopRevisit {
  Stamp old_stamp;  ///< of the keyframes' images
  Stamp new_stamp;
  SE3 T_old_new;  ///< m, between the bodies
  Eigen::Matrix<double, 6, 6> information =
      Eigen::Matrix<double, 6, 6>::Identity();  ///< of T_old_new, right perturbation (phi, p), 1/rad^2, 1/m^2
  std::vector<RevisitMatch> matches;
};

}  // namespace swiftlet
