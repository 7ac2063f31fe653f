#pragma once
// The mesh of the near surroundings: landmarks joined by triangles, for planners and for display.
//
// World axes, metres. A face is counter-clockwise seen from where it was seen.

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

/// A label nobody gave; the values of the others are the segmentation's.
inline constexpr std::uint8_t kNoLabel = 0;

struct MeshVertex {
  TrackId id = 0;
  Eigen::Vector3f p_world = Eigen::Vector3f::Zero();
  std::uint8_t grey = 128;
};

struct MeshFace {
  std::array<std::uint32_t, 3> vertex{};  ///< indices of the vertices beside it
  std::uint8_t label = kNoLabel;
};

struct LocalMesh {
  std::uint32_t epoch = 0;
  Stamp stamp;                    ///< of the newest frame in it
  std::uint64_t frame_index = 0;  ///< that frame's
  FixedVector<MeshVertex, kMaxMeshVertices> vertices;
  FixedVector<MeshFace, kMaxMeshFaces> faces;
};

}  // namespace swiftlet
