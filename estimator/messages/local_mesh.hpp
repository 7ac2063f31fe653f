#pragma once
// The mesh of the surroundings: triangles over landmarks, for planners and display.
//
// World axes, metres. Faces are counter-clockwise seen from the side from which they were observed.

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

/// No label; other values are defined by the segmentation.
inline constexpr std::uint8_t kNoLabel = 0;

struct MeshVertex {
  TrackId id = 0;
  Eigen::Vector3f p_world = Eigen::Vector3f::Zero();
  std::uint8_t grey = 128;
};

struct MeshFace {
  std::array<std::uint32_t, 3> vertex{};  ///< indices into the mesh's vertices
  std::uint8_t label = kNoLabel;
};

struct LocalMesh {
  std::uint32_t epoch = 0;
  Stamp stamp;                    ///< of the newest frame in it
  std::uint64_t frame_index = 0;  ///< of that frame
  FixedVector<MeshVertex, kMaxMeshVertices> vertices;
  FixedVector<MeshFace, kMaxMeshFaces> faces;
};

}  // namespace swiftlet
