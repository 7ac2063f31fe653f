#pragma once
// Registers a mesh to the true surface, so that its own shape is evaluated and not the odometry's drift.
//
// Iterated closest points, point to plane (Chen, Medioni, "Object modelling by registration of multiple range
// images", IVC 1992): evenly spread samples of the mesh, each with the plane of the nearest true triangle; a
// rigid motion by least squares with Huber weights; repeated until it converges. No scale. The start must be
// near: pairs farther apart than kFurthestPair are omitted, so that parts without truth do not pull.

#include "firmware_host/lab/evaluation/mesh_error.hpp"

namespace swiftlet {

/// Roughly the distance from a wall, as a part of a room between two walls, up to which the nearest triangle
/// is the right one [m].
inline constexpr double kFurthestPair = 0.3;

struct MeshRegistration {
  Alignment motion;       ///< of the mesh, rigid
  std::size_t pairs = 0;  ///< of the last iteration
  int iterations = 0;
  bool settled = false;  ///< the last step was below a tenth of a millimetre and of a milliradian
};

/// `mesh` must be roughly in the true surface's axes. Returns the identity if fewer than 100 samples have a
/// partner.
MeshRegistration registerMesh(const TriangleMesh& mesh, const TriangleMesh& truth,
                              const TrueSurface& surface);

}  // namespace swiftlet
