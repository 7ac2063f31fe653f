#include "firmware_host/outputs/map_files/map_output.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <set>
#include <vector>

#include "firmware_host/outputs/map_files/map_files.hpp"

namespace swiftlet {
namespace {

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
      // Corners that fell into one leave a line.
      if (face[0] == face[1] || face[1] == face[2] || face[2] == face[0]) continue;
      mesh.faces.push_back(face);
    }
  }
  return mesh;
}

/// What became of depth images and blocks.
nlohmann::ordered_json toJson(const MapStage& map) {
  const MapCounters& stage = map.counters();
  const IntegratorCounters& images = map.integrator().counters();
  const VolumeCounters& blocks = map.volume().counters();
  const SurfaceStoreCounters& store = map.surface().counters();
  const DistanceField& distance = map.distance();
  const MapSubmaps& submaps = map.submaps();
  return {{"taken", stage.taken},
          {"without_depth", stage.without_depth},
          {"wrong_size", stage.wrong_size},
          {"epochs", stage.epochs},
          {"refused",
           {{"all", images.refused},
            {"pose_jumps", images.pose_jumps},
            {"bad_poses", images.bad_poses},
            {"bad_stamps", images.bad_stamps}}},
          {"pixels",
           {{"unmeasured", images.pixels.unmeasured},
            {"beyond_range", images.pixels.beyond_range},
            {"uncertain", images.pixels.uncertain},
            {"masked", images.pixels.masked},
            {"bad_label", images.pixels.bad_label}}},
          {"blocks",
           {{"held", map.volume().blockCount()},
            {"capacity", map.volume().blockCapacity()},
            {"free", map.volume().freeCount()},
            {"evicted", blocks.evicted},
            {"evicted_free", blocks.evicted_free},
            {"refused", blocks.refused},
            {"out_of_range", blocks.out_of_range},
            {"index_full", blocks.index_full},
            {"left_out", images.blocks_left_out}}},
          {"submaps",
           {{"begun", submaps.submaps().size()},
            {"corrections", submaps.counters().corrections},
            {"blocks_moved", submaps.counters().blocks_moved},
            {"blocks_back", submaps.counters().blocks_back},
            {"blocks_apart", submaps.counters().blocks_apart},
            {"blocks_stored", submaps.stored().size()},
            {"blocks_lost", submaps.stored().lost()},
            {"bytes_stored", submaps.stored().bytesStored()}}},
          {"surface",
           {{"patches", map.surface().patches()},
            {"pages", map.surface().pagesUsed()},
            {"capacity", map.surface().pages()},
            {"drawn", map.surfaceStage().counters().drawn},
            {"dropped", store.dropped}}},
          {"bytes",
           {{"volume", map.volume().bytes()},
            {"surface", map.surface().bytes()},
            {"distance", distance.bytes()},
            {"submaps", submaps.bytes()}}}};
}

}  // namespace

nlohmann::ordered_json writeMap(const std::string& folder, MapStage& map,
                                std::span<const std::uint32_t> tied) {
  const std::filesystem::path path(folder);
  const auto isTied = [&](std::uint32_t epoch) {
    return epoch == map.epoch() || std::ranges::find(tied, epoch) != tied.end();
  };
  nlohmann::ordered_json json = toJson(map);
  MapMeshBuilder builder;
  map.visitWholeSurface(isTied, builder);
  const MapMesh mesh = builder.mesh();
  writeMapPly((path / "map.ply").string(), mesh);
  writeMapGlb((path / "map.glb").string(), mesh);
  json["mesh"] = {{"vertices", mesh.vertices.size()}, {"faces", mesh.faces.size()}};
  json["epochs_apart"] = nlohmann::ordered_json::array();
  std::set<std::uint32_t> apart;
  for (std::size_t i = 0; i < map.submaps().submaps().size(); ++i) {
    const std::uint32_t epoch = map.submaps().submaps()[i].epoch;
    if (!isTied(epoch)) apart.insert(epoch);
  }
  for (const std::uint32_t epoch : apart) {
    MapMeshBuilder own;
    map.visitWholeSurface([&](std::uint32_t e) { return e == epoch; }, own);
    const MapMesh part = own.mesh();
    const std::string name = fmt::format("map_epoch_{}.ply", epoch);
    writeMapPly((path / name).string(), part);
    json["epochs_apart"].push_back({{"file", name}, {"faces", part.faces.size()}});
  }
  return json;
}

}  // namespace swiftlet
