#pragma once
// The data that the plane finder reads from a mesh once per keyframe: vertices with their noise, faces with
// their normals.
//
// World axes, origin at the viewer, because noise, votes and gates depend on the distance from the viewer.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/messages/local_mesh.hpp"
#include "estimator/messages/smoothed_window.hpp"

namespace swiftlet {

struct VertexFacts {
  Eigen::Vector3f p = Eigen::Vector3f::Zero();    ///< m, from the viewer
  Eigen::Vector3f ray = Eigen::Vector3f::Zero();  ///< unit, from the viewer
  float depth_sigma = 0;                          ///< m, along the ray
  bool finite = false;
  bool measured = false;  ///< a landmark of the window, so its sigma is known
};

struct FaceFacts {
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  ///< unit, towards the viewer
  float area = 0;                                    ///< m^2; 0: unusable (not finite, bad index, collinear)
  bool taken = false;                                ///< belongs to a plane of this keyframe
};

class MeshFacts {
 public:
  /// Cost: a sort of the window's landmarks and a search for each vertex.
  void read(const LocalMesh& mesh, const SmoothedWindow& window);

  FixedVector<VertexFacts, kMaxMeshVertices> vertices;
  FixedVector<FaceFacts, kMaxMeshFaces> faces;
  Eigen::Vector3d viewer = Eigen::Vector3d::Zero();  ///< m, world: the newest pose
  int refused = 0;  ///< vertices and faces that are not finite or have invalid indices

 private:
  struct Known {
    TrackId id = 0;
    float inverse_depth_sigma = 0;
  };
  FixedVector<Known, kMaxLandmarks> known_;
};

}  // namespace swiftlet
