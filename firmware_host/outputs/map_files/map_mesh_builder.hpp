#pragma once
// One mesh of a surface's patches.

#include <map>
#include <vector>

#include "firmware_host/outputs/map_files/map_mesh.hpp"
#include "mapping/surface/surface_patch.hpp"
#include "mapping/surface/surface_store.hpp"

namespace swiftlet {

/// Joins the patches of a surface into one mesh: vertices of neighbouring patches at bit-identical positions
/// become one. Memory grows with the mesh, some 60 bytes a vertex.
class MapMeshBuilder : public SurfaceSink {
 public:
  void take(const SurfacePatch& patch) override;
  /// All patches taken, in the order of their blocks.
  [[nodiscard]] MapMesh mesh() const;

 private:
  struct Kept {
    std::vector<SurfaceVertex> vertices;
    std::vector<SurfaceTriangle> triangles;
  };
  std::map<BlockIndex, Kept> patches_;
};

}  // namespace swiftlet
