#include "firmware_host/outputs/map_files/map_mesh_builder.hpp"

#include <array>
#include <cstdint>

namespace swiftlet {

void MapMeshBuilder::take(const SurfacePatch& patch) {
  Kept& kept = patches_[patch.block];
  kept.vertices.assign(patch.vertices.begin(), patch.vertices.end());
  kept.triangles.assign(patch.triangles.begin(), patch.triangles.end());
}

MapMesh MapMeshBuilder::mesh() const {
  MapMesh mesh;
  std::map<std::array<float, 3>, std::uint32_t> places;
  std::vector<std::uint32_t> joined;
  for (const auto& [block, patch] : patches_) {
    joined.clear();
    for (const SurfaceVertex& vertex : patch.vertices) {
      const Eigen::Vector3f& p = vertex.p_world;
      const auto next = static_cast<std::uint32_t>(mesh.vertices.size());
      const auto [place, is_new] = places.try_emplace({p.x(), p.y(), p.z()}, next);
      joined.push_back(place->second);
      if (!is_new) continue;
      const Eigen::Vector3f normal(vertex.normal[0], vertex.normal[1], vertex.normal[2]);
      mesh.vertices.push_back(p);
      mesh.normals.push_back(normal.isZero(0) ? Eigen::Vector3f::UnitZ()
                                              : Eigen::Vector3f(normal.normalized()));
      mesh.grey.push_back(vertex.grey);
      mesh.labels.push_back(vertex.label);
      mesh.probabilities.push_back(vertex.probability);
    }
    for (const SurfaceTriangle& triangle : patch.triangles) {
      const std::array<std::uint32_t, 3> face{joined[triangle[0]], joined[triangle[1]], joined[triangle[2]]};
      // A triangle with merged corners has no area.
      if (face[0] == face[1] || face[1] == face[2] || face[2] == face[0]) continue;
      mesh.faces.push_back(face);
    }
  }
  return mesh;
}

}  // namespace swiftlet
