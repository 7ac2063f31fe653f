#pragma once
// Camera pose from three points known in space and their bearings (P3P).
//
// Grunert 1841 in the form of Haralick et al., "Review and analysis of solutions of the three point
// perspective pose estimation problem", IJCV 1994: law of cosines on the three distances, a quartic, then the
// alignment of the two triangles (alignRigid). Up to four poses. No allocation; about 4 us.

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

/// `points[i]` in frame A, `bearings[i]` unit in camera B: poses T_A_B. Empty if the points are collinear or
/// no distances fit.
FixedVector<SE3, 4> poseFromThreePoints(const std::array<Eigen::Vector3d, 3>& points,
                                        const std::array<Eigen::Vector3d, 3>& bearings);

}  // namespace swiftlet
