#pragma once
// Motion from the fewest correspondences of unit bearings (any lens, any angle).
//
// For bearings and points of the previous and the current camera frame: p_cur = R p_prev + t, and E = hat(t)
// R, so that cur^T E prev = 0.

#include <Eigen/Core>
#include <array>
#include <span>

#include "estimator/core/fixed_vector.hpp"

namespace swiftlet {

inline constexpr std::size_t kMaxEssentials = 10;

/// Essential matrices through five correspondences, each of Frobenius norm sqrt(2); none if the five are
/// numerically degenerate. Nister, "An efficient solution to the five-point relative pose problem", PAMI
/// 2004: null space, ten cubics, elimination, a polynomial of degree ten. No allocation; about 6 us.
FixedVector<Eigen::Matrix3d, kMaxEssentials> essentialFromFivePoints(std::span<const Eigen::Vector3d, 5> prev,
                                                                     std::span<const Eigen::Vector3d, 5> cur);

struct EssentialMotions {
  std::array<Eigen::Matrix3d, 2> R;  ///< the two rotations
  Eigen::Vector3d t;                 ///< unit; its sign is undetermined, so t and -t give four motions
};

/// The motions of an essential matrix of Frobenius norm sqrt(2). Horn, "Recovering baseline and
/// orientation from essential matrix", 1990: by cofactors, without a decomposition.
EssentialMotions motionsOfEssential(const Eigen::Matrix3d& E);

/// Rotation that maps two bearings to two others, without translation: exact for the first bearing and for
/// the plane of both. Not finite if the two bearings coincide.
Eigen::Matrix3d rotationFromTwoPoints(std::span<const Eigen::Vector3d, 2> prev,
                                      std::span<const Eigen::Vector3d, 2> cur);

/// Direction of translation from two correspondences and the rotation; unit, with the sign for which both
/// points are in front. Zero if the two do not determine a direction (no parallax, or both in one plane with
/// the translation). Troiani et al., ICRA 2014.
Eigen::Vector3d translationFromTwoPoints(const Eigen::Matrix3d& R, std::span<const Eigen::Vector3d, 2> prev,
                                         std::span<const Eigen::Vector3d, 2> cur);

}  // namespace swiftlet
