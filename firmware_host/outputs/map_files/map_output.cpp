#include "firmware_host/outputs/map_files/map_output.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "firmware_host/outputs/map_files/map_files.hpp"
#include "firmware_host/outputs/map_files/map_mesh_builder.hpp"
#include "mapping/loop/loop_map.hpp"

namespace swiftlet {
namespace {

/// Counters of depth images and blocks.
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
          {"without_submap", stage.without_submap},
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
            {"reads_failed", submaps.stored().readsFailed()},
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
    if (!isTied(epoch) && epoch < kKeptEpochs) apart.insert(epoch);
  }
  for (const std::uint32_t epoch : apart) {
    MapMeshBuilder own;
    map.visitWholeSurface([&](std::uint32_t e) { return e == epoch; }, own);
    const MapMesh part = own.mesh();
    const std::string name = fmt::format("map_epoch_{}.ply", epoch);
    writeMapPly((path / name).string(), part);
    json["epochs_apart"].push_back({{"file", name}, {"faces", part.faces.size()}});
  }
  json["submaps"]["reads_failed"] = map.submaps().stored().readsFailed();  // includes the reads above
  return json;
}

std::string unreadProblem(const std::string& folder, const MapSubmaps& submaps) {
  const std::uint64_t count = submaps.stored().readsFailed();
  if (count == 0) return {};
  return fmt::format(
      "{}: blocks of the map could not be read back from disk ({} reads failed): the map has holes", folder,
      count);
}

}  // namespace swiftlet
