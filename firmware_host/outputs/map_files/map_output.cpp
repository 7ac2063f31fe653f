#include "firmware_host/outputs/map_files/map_output.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "firmware_host/outputs/map_files/map_files.hpp"
#include "firmware_host/outputs/map_files/map_mesh_builder.hpp"
#include "firmware_host/outputs/map_files/map_report.hpp"

namespace swiftlet {

nlohmann::ordered_json writeMap(const std::string& folder, MapStage& map, SpilledSurface& spilled,
                                std::span<const std::uint32_t> tied) {
  const std::filesystem::path path(folder);
  const auto isTied = [&](std::uint32_t epoch) {
    return epoch == map.epoch() || std::ranges::find(tied, epoch) != tied.end();
  };
  MapMeshBuilder builder;
  nlohmann::ordered_json submaps = nlohmann::ordered_json::array();
  for (const std::uint32_t epoch : spilled.submaps()) {
    if (isTied(epoch)) {
      spilled.visit(epoch, builder);
      continue;
    }
    MapMeshBuilder apart;
    spilled.visit(epoch, apart);
    const MapMesh mesh = apart.mesh();
    const std::string name = fmt::format("map_epoch_{}.ply", epoch);
    writeMapPly((path / name).string(), mesh);
    submaps.push_back({{"file", name}, {"faces", mesh.faces.size()}});
  }
  map.visitSurface(builder);
  const MapMesh mesh = builder.mesh();
  writeMapPly((path / "map.ply").string(), mesh);
  writeMapGlb((path / "map.glb").string(), mesh);
  nlohmann::ordered_json json = toJson(map);
  json["mesh"] = {{"vertices", mesh.vertices.size()}, {"faces", mesh.faces.size()}};
  json["submaps"] = submaps;
  json["surface"]["spilled_lost"] = spilled.lost();
  return json;
}

}  // namespace swiftlet
