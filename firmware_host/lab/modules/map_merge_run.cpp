#include "firmware_host/lab/modules/map_merge_run.hpp"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "firmware_host/outputs/map_files/block_file.hpp"
#include "firmware_host/outputs/map_files/kept_folder.hpp"
#include "firmware_host/outputs/map_files/kept_map.hpp"
#include "mapping/loop/loop_stage.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

Json graphJson(const KeptGraph& graph) {
  std::size_t pieces = graph.nodes.empty() ? 0 : 1, places = 0, features = 0;
  Eigen::AlignedBox3d box;
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    const KeptNode& node = graph.nodes[i];
    pieces += i > 0 && !node.linked ? 1 : 0;
    places += node.features.empty() ? 0 : 1;
    features += node.features.size();
    box.extend(node.T_map_body.translation);
  }
  Json json = {{"nodes", graph.nodes.size()},
               {"pieces", pieces},
               {"loops", graph.loops.size()},
               {"places", places},
               {"features", features}};
  if (!graph.nodes.empty()) {
    for (int axis = 0; axis < 3; ++axis) {
      json["extent_m"][std::string(1, "xyz"[axis])] = {box.min()[axis], box.max()[axis]};
    }
  }
  return json;
}

void demand(const Status& status, const std::string& folder) {
  if (!status.ok()) throw InputError(folder, 0, "", status.what, "Choose another kept map");
}

/// Moves each block with the nodes of its own map to their new poses.
void mergeVolumes(const MapMergeRequest& request, const LoopStage& stage,
                  const std::vector<std::uint32_t>& epochs, KeptFolder& out) {
  struct Part {
    std::string path;
    std::size_t begin, end;  ///< indices of nodes
  };
  std::vector<Part> parts{{keptVolumeOf(request.first), 0, stage.keptCount()},
                          {keptVolumeOf(request.second), stage.keptCount(), stage.nodeCount()}};
  std::erase_if(parts, [](const Part& part) { return !std::filesystem::exists(part.path); });
  if (parts.empty()) return;
  VolumeSettings settings = keptMapSettings(parts.front().path).volume;
  settings.memory_bytes = VoxelVolume::bytesFor(1, settings.labels);
  VoxelVolume volume(settings);
  BlockFile storage(out.folder());
  MapSubmaps submaps(volume, &storage, MapPoses::kEstimated, Eigen::Vector3d::Zero());
  std::vector<WorldInMap> worlds;
  double least_weight = SurfaceSettings{}.least_weight;
  for (const Part& part : parts) {
    least_weight = std::min(least_weight, keptMapSettings(part.path).least_weight);
    std::vector<WorldInMap> nodes;
    for (std::size_t i = part.begin; i < part.end; ++i) {
      const MapNode node = stage.node(i);
      nodes.push_back({node.frame, node.epoch, node.T_map_body, node.T_world_body});
    }
    checkKeptMapFile(part.path, settings);
    readKeptSubmaps(part.path, submaps, nodes);
    worlds.insert(worlds.end(), nodes.begin(), nodes.end());
  }
  std::ranges::sort(worlds, {}, &WorldInMap::frame);
  submaps.correct(worlds);
  const auto is_kept = [&](const Submap& submap) {
    return std::ranges::find(epochs, submap.epoch) != epochs.end();
  };
  const VoxelVolume whole = submaps.wholeVolume(is_kept);
  if (submaps.stored().readsFailed() > 0) {
    throw InputError(out.folder(), 0, "", "blocks of the maps could not be read back from this disk",
                     "Check the disk, or write to another one. No map was written");
  }
  out.write(whole, least_weight);
}

}  // namespace

Json runMapMerge(const MapMergeRequest& request) {
  const KeptGraph first = readKeptFolder(request.first);
  const KeptGraph second = readKeptFolder(request.second);
  KeptFolder out(request.out);
  LoopLimits limits;
  limits.nodes = first.nodes.size() + second.nodes.size();
  limits.loops += first.loops.size() + second.loops.size();
  Rig rig;
  rig.camera_count = 1;
  rig.camera[0] = first.camera;
  rig.T_body_cam[0] = first.T_body_cam;
  const auto stage = std::make_unique<LoopStage>(rig, LoopSettings{}, limits);
  demand(stage->takeIn(first, KeptUse::kExtend), request.first);
  LoopEffort effort;
  effort.candidates = kMaxLoopCandidates;  // computing time is not limited here
  demand(stage->flyAgain(second, effort), request.second);
  KeptGraph merged;
  const std::vector<std::uint32_t> epochs = stage->keep(merged);
  if (merged.nodes.size() == first.nodes.size()) {
    throw InputError(request.second, 0, "", "no loops connect this map to " + request.first,
                     "Merge maps that show the same places. Nothing was written");
  }
  out.write(merged);
  mergeVolumes(request, *stage, epochs, out);
  out.commit();
  Json json = {{"first", graphJson(first)}, {"second", graphJson(second)}, {"merged", graphJson(merged)}};
  const auto between = [&](const KeptLoop& loop) {
    return loop.from < first.nodes.size() && loop.to >= first.nodes.size();
  };
  json["loops_between"] = std::count_if(merged.loops.begin(), merged.loops.end(), between);
  return json;
}

Json mapInfo(const std::string& folder) {
  Json json = graphJson(readKeptFolder(folder));
  json["graph_bytes"] = std::filesystem::file_size(std::filesystem::path(folder) / kKeptGraphFile);
  const std::filesystem::path volume = std::filesystem::path(folder) / kKeptVolumeFile;
  if (!std::filesystem::exists(volume)) return json;
  const VoxelVolume held = readKeptVolumeFile(volume.string());
  std::size_t blocks = 0, free_blocks = 0;
  for (std::uint32_t slot = 0; slot < held.slots(); ++slot) {
    blocks += held.header(slot).state == BlockState::kVoxels ? 1 : 0;
    free_blocks += held.header(slot).state == BlockState::kFree ? 1 : 0;
  }
  json["volume"] = {{"bytes", std::filesystem::file_size(volume)},
                    {"voxel_size_m", held.settings().voxel_size},
                    {"blocks", blocks},
                    {"free_blocks", free_blocks}};
  return json;
}

}  // namespace swiftlet
