#pragma once
// Lays a mesh on the true surface, so that its own shape is judged and not where the odometry put it.
//
// Iterated closest points, point to plane (Chen, Medioni, "Object modelling by registration of multiple range
// images", IVC 1992): evenly spread samples of the mesh, each with the plane of the true triangle nearest to
// it; a rigid motion by least squares with Huber weights; again until it rests. No scale. The start must be
// near: pairs further apart than kFurthestPair are left out, so that what the truth does not have does not
// pull.

#include "firmware_host/lab/evaluation/mesh_error.hpp"

namespace swiftlet {

/// About the share of a room between two of its walls at which the nearest triangle is still the right one
/// [m].
inline constexpr double kFurthestPair = 0.3;

struct MeshRegistration {
  Alignment motion;       ///< of the mesh, rigid
  std::size_t pairs = 0;  ///< of the last iteration
  int iterations = 0;
  bool settled = false;  ///< the last step was below a tenth of a millimetre and of a milliradian
};

/// `mesh` in the true surface's axes, roughly. The identity where fewer than 100 samples have a partner.
MeshRegistration registerMesh(const TriangleMesh& mesh, const TriangleMesh& truth,
                              const TrueSurface& surface);

}  // namespace swiftlet
