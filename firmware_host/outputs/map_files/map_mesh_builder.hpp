#pragma once
// Joins the patches of a surface into one mesh: vertices of neighbouring patches at bit-identical positions
// become one. Where a block comes twice (first spilled, later drawn anew) the later patch counts. Host side:
// memory grows with the mesh, some 60 bytes a vertex.

#include <map>

#include "firmware_host/outputs/map_files/map_mesh.hpp"
#include "mapping/surface/surface_store.hpp"

namespace swiftlet {

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
