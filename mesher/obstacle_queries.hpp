#pragma once
// What a planner asks of the newest mesh.
//
// Plain functions of a LocalMesh that the caller holds: of a newest value (estimator/core/newest.hpp) that is
// without locks, and the mesh does not change meanwhile. World axes, metres. Faces count from both sides.
// Cost: linear in faces, about 10 ns each; nothing is allocated.

#include <Eigen/Core>
#include <optional>

#include "estimator/geometry/se3.hpp"
#include "estimator/messages/local_mesh.hpp"

namespace swiftlet {

struct Obstacle {
  Eigen::Vector3f point = Eigen::Vector3f::Zero();
  float distance = 0;    ///< m, from the ray's origin or the box's centre
  std::size_t face = 0;  ///< index in the mesh
  std::uint8_t label = kNoLabel;
};

/// The first face that the ray meets within `reach` [m]. `direction`: any length but zero.
/// Source: Moeller, Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection", 1997.
std::optional<Obstacle> nearestAlongRay(const LocalMesh& mesh, const Eigen::Vector3f& origin,
                                        const Eigen::Vector3f& direction, float reach);

/// The point of the mesh inside the box that is nearest to its centre. `half_size`: along the box's axes,
/// above zero. Faces are cut by the box's sides (Sutherland, Hodgman, "Reentrant polygon clipping", 1974).
std::optional<Obstacle> nearestInBox(const LocalMesh& mesh, const SE3& T_world_box,
                                     const Eigen::Vector3f& half_size);

}  // namespace swiftlet
