#pragma once
// What a planner asks of the newest mesh.
//
// Plain functions of a LocalMesh that the caller holds: of a newest value (estimator/core/newest.hpp) that is
// without locks, and the mesh does not change meanwhile. World axes, metres. Faces count from both sides.
// Cost: linear in faces, about 10 ns each; nothing is allocated.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <limits>
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

/// Around a vehicle, clockwise seen from above: sector 0 is centred on its heading.
inline constexpr std::size_t kObstacleSectors = 72;
/// Horizontal distance [m] to the nearest of what the mesh has in each sector; kNothingKnown where it has
/// nothing, which does not say that there is nothing.
using SectorDistances = std::array<float, kObstacleSectors>;
inline constexpr float kNothingKnown = std::numeric_limits<float>::infinity();

struct SectorQuery {
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();  ///< the vehicle, world
  float heading = 0;   ///< [rad] of its forward axis from the world's x to its y
  float below = 0.5F;  ///< [m] what lies lower than this under it does not count
  float above = 0.5F;  ///< [m] likewise over it
  float reach = 20;    ///< [m]
};

/// Cost: about 0.1 us a face in the band and sector that it crosses.
SectorDistances nearestBySector(const LocalMesh& mesh, const SectorQuery& query);

}  // namespace swiftlet
