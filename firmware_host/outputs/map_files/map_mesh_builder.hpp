#pragma once
// Makes one mesh from a surface's patches.

#include <map>
#include <vector>

#include "firmware_host/outputs/map_files/map_mesh.hpp"
#include "mapping/surface/surface_patch.hpp"
#include "mapping/surface/surface_store.hpp"

namespace swiftlet {

/// Joins the patches of a surface into one mesh: vertices of neighbouring patches at bit-identical positions
/// are merged. Memory grows with the mesh, some 60 bytes per vertex.
class MapMeshBuilder : public SurfaceSink {
 public:
  void take(const SurfacePatch& patch) override;
  /// The mesh of all patches so far, in the order of their blocks.
  [[nodiscard]] MapMesh mesh() const;

 private:
  struct Kept {
    std::vector<SurfaceVertex> vertices;
    std::vector<SurfaceTriangle> triangles;
  };
  std::map<BlockIndex, Kept> patches_;
};

}  // namespace swiftlet
