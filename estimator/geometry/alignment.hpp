#pragma once
// Best transform from one point set to another in the least-squares sense.
//
// `to[i] ~ s R from[i] + t`. Sources: Umeyama, PAMI 1991 (rotation, translation, scale; Arun et al., PAMI
// 1987 without scale); rotation about z alone in closed form (Zhang, Scaramuzza, IROS 2018, section III-C:
// the four unobservable directions of a visual-inertial estimate). Double precision on centred points; no
// allocation; O(n), two passes.

#include <Eigen/Core>
#include <span>

#include "estimator/core/status.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

struct Alignment {
  SE3 T_to_from;       ///< rotation and translation
  double scale = 1.0;  ///< s; 1 unless alignSimilarity
  double rms = 0;      ///< root of the mean squared distance after the fit, in units of `to`

  Eigen::Vector3d operator*(const Eigen::Vector3d& from) const {
    return T_to_from.rotation * (scale * from) + T_to_from.translation;
  }
};

using Points = std::span<const Eigen::Vector3d>;

/// SE(3): at least 3 points that are not collinear. kDegenerate (with the best translation and one rotation
/// that fits) if they are collinear or coincide; kInvalidInput if sizes differ, the sets are empty or a value
/// is not finite (`result` is then unchanged).
Status alignRigid(Points from, Points to, Alignment& result);

/// Sim(3): as alignRigid, plus scale. kDegenerate also if `from` has no extent.
Status alignSimilarity(Points from, Points to, Alignment& result);

/// Rotation about z and translation: at least 2 points with different x, y.
Status alignYaw(Points from, Points to, Alignment& result);

}  // namespace swiftlet
