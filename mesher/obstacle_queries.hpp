#pragma once
// Obstacle queries for planners on the newest mesh.
//
// Plain functions of a LocalMesh that the caller holds, for example from a newest value
// (estimator/core/newest.hpp), which needs no lock. World axes, metres. Faces count from both sides. Cost:
// linear in faces, about 10 ns each; no allocation.

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
  float distance = 0;    ///< m, from the origin of the ray or the centre of the box
  std::size_t face = 0;  ///< index in the mesh
  std::uint8_t label = kNoLabel;
};

/// The first face that the ray hits within `reach` [m]. `direction`: any length but zero.
/// Source: Moeller, Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection", 1997.
std::optional<Obstacle> nearestAlongRay(const LocalMesh& mesh, const Eigen::Vector3f& origin,
                                        const Eigen::Vector3f& direction, float reach);

/// The point of the mesh inside the box that is nearest to its centre. `half_size`: along the box's axes,
/// above zero. Faces are clipped by the box (Sutherland, Hodgman, "Reentrant polygon clipping", 1974).
std::optional<Obstacle> nearestInBox(const LocalMesh& mesh, const SE3& T_world_box,
                                     const Eigen::Vector3f& half_size);

/// Sectors around the vehicle, clockwise seen from above; sector 0 is centred on its heading.
inline constexpr std::size_t kObstacleSectors = 72;
/// Horizontal distance [m] to the nearest point of the mesh in each sector. Above SectorQuery::reach: faces
/// cross the whole width of the sector, all beyond the reach, so it is free as far as the mesh tells.
/// kNothingKnown: the sector may contain obstacles.
using SectorDistances = std::array<float, kObstacleSectors>;
inline constexpr float kNothingKnown = std::numeric_limits<float>::infinity();

struct SectorQuery {
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();  ///< the vehicle, world
  float heading = 0;   ///< [rad] of its forward axis from the world's x to its y
  float below = 0.5F;  ///< [m] points lower than this below the vehicle are ignored
  float above = 0.5F;  ///< [m] points higher than this above the vehicle are ignored
  float reach = 20;    ///< [m] up to this distance, a face in any part of a sector counts
};

/// Cost: about 0.1 us per face in the band and sector crossed.
SectorDistances nearestBySector(const LocalMesh& mesh, const SectorQuery& query);

}  // namespace swiftlet
