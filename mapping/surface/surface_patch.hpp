#pragma once
// The surface within one block: the triangles of its cubes.
//
// World axes, metres. Triangles are counter-clockwise seen from the front (the free side). Vertices on the
// border to a neighbour are in both patches at bit-identical positions; to get one mesh, join vertices of
// equal position.

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "mapping/volume/block_index.hpp"

namespace swiftlet {

struct SurfaceVertex {
  Eigen::Vector3f p_world = Eigen::Vector3f::Zero();
  std::array<std::int8_t, 3> normal{};  ///< towards the front, unit length is 127
  std::uint8_t grey = 0;
  std::uint8_t label = 0;        ///< the most likely label; 0: none was seen
  std::uint8_t probability = 0;  ///< of the label, 255 is 1
};

using SurfaceTriangle = std::array<std::uint16_t, 3>;

/// Upper bounds: every edge crossed, and the most triangles in every cube.
inline constexpr std::size_t kMostPatchVertices = 3 * kBlockSide * (kBlockSide + 1) * (kBlockSide + 1);
inline constexpr std::size_t kMostPatchTriangles = 6 * kBlockVoxels;

struct SurfacePatch {
  BlockIndex block;
  SubmapId submap = 0;  ///< of the block
  FixedVector<SurfaceVertex, kMostPatchVertices> vertices;
  FixedVector<SurfaceTriangle, kMostPatchTriangles> triangles;
};

}  // namespace swiftlet
