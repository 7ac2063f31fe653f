#include "firmware_host/lab/modules/map_export_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/image_files.hpp"
#include "estimator/core/units.hpp"
#include "firmware_host/files/new_folder.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/outputs/map_files/kept_folder.hpp"
#include "firmware_host/outputs/map_files/kept_map.hpp"
#include "firmware_host/outputs/map_files/map_files.hpp"
#include "firmware_host/outputs/map_files/map_mesh_builder.hpp"
#include "firmware_host/outputs/map_files/voxel_file.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint8_t kOccupied = 0, kFree = 254, kUnseen = 205, kNoPercent = 255;
/// Defaults of map_server: between free (1 - 254 / 255) and unseen (1 - 205 / 255 = 0.1961), and between
/// unseen and occupied (1).
constexpr double kFreeThreshold = 0.196, kOccupiedThreshold = 0.65;

MapMesh meshOf(const VoxelVolume& volume, const ConfusionModel& confusion, double least_weight) {
  SurfaceSettings settings;
  settings.least_weight = least_weight;
  BlockSurface surface(volume, confusion, settings);
  MapMeshBuilder builder;
  const auto patch = std::make_unique<SurfacePatch>();
  for (std::uint32_t slot = 0; slot < volume.slots(); ++slot) {
    surface.extract(slot, *patch);
    if (!patch->triangles.empty()) builder.take(*patch);
  }
  return builder.mesh();
}

void writeGrid(const NewFolder& out, const std::string& name, const std::vector<std::uint8_t>& pixels,
               const MapSlice& slice, const std::string& mode) {
  writePng8(out.file(name + ".png"), pixels.data(), slice.width, slice.height);
  const std::string yaml = fmt::format(
      "image: {}.png\nresolution: {}\norigin: [{:.9g}, {:.9g}, 0]\nnegate: 0\n"
      "occupied_thresh: {}\nfree_thresh: {}\nmode: {}\n",
      name, slice.voxel_size, slice.least.x(), slice.least.y(), kOccupiedThreshold, kFreeThreshold, mode);
  writeWholeFile(out.file(name + ".yaml"), yaml);
}

}  // namespace

std::vector<std::uint8_t> occupancyPixels(const MapSlice& slice) {
  std::vector<std::uint8_t> pixels(slice.kind.size(), kUnseen);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const SliceKind kind = slice.kind[i];
    if (kind == SliceKind::kSurface) pixels[i] = kOccupied;
    if (kind == SliceKind::kAtLeast || kind == SliceKind::kDistance) pixels[i] = kFree;
  }
  return pixels;
}

std::vector<std::uint8_t> distancePixels(const MapSlice& slice) {
  std::vector<std::uint8_t> pixels(slice.kind.size(), 0);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const SliceKind kind = slice.kind[i];
    double percent = 0;
    if (kind == SliceKind::kUnknown) percent = kNoPercent;
    if (kind == SliceKind::kAtLeast) percent = kPercent;
    if (kind == SliceKind::kDistance)
      percent = std::clamp(kPercent * static_cast<double>(slice.distance[i]) / slice.reach, 0.0, kPercent);
    pixels[i] = static_cast<std::uint8_t>(std::lround(percent));
  }
  return pixels;
}

Json runMapExport(const MapExportRequest& request) {
  const std::string kept = keptVolumeOf(request.map);
  const VoxelVolume volume = readKeptVolumeFile(kept);
  const MapSlice slice = sliceOf(kept, volume, request.z);
  NewFolder out(request.out, {"surface.ply", "surface.glb", "voxels.ply", "occupancy.png", "occupancy.yaml",
                              "distance.png", "distance.yaml"});
  const ConfusionModel confusion;
  const MapMesh mesh = meshOf(volume, confusion, keptMapSettings(kept).least_weight);
  writeMapPly(out.file("surface.ply"), mesh);
  writeMapGlb(out.file("surface.glb"), mesh);
  const std::size_t voxels = writeVoxelPly(out.file("voxels.ply"), volume, confusion);
  writeGrid(out, "occupancy", occupancyPixels(slice), slice, "trinary");
  writeGrid(out, "distance", distancePixels(slice), slice, "raw");
  out.commit();
  return {{"vertices", mesh.vertices.size()},
          {"faces", mesh.faces.size()},
          {"voxels", voxels},
          {"pixels", {{"width", slice.width}, {"height", slice.height}}},
          {"z_m", slice.z},
          {"reach_m", slice.reach}};
}

}  // namespace swiftlet
