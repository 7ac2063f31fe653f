#include "firmware_host/outputs/map_files/voxel_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/outputs/map_files/ply_writer.hpp"

namespace swiftlet {
namespace {

std::string headOf(std::size_t voxels) {
  PlyElement element{"vertex", voxels, {{"x"}, {"y"}, {"z"}, {"distance"}, {"weight"}}};
  for (const char* name : {"red", "green", "blue", "label", "label_probability"}) {
    element.properties.push_back({name, PlyType::kUint8});
  }
  return writePlyHeader({element}, kMapComment);
}

}  // namespace

std::size_t writeVoxelPly(const std::string& path, const VoxelVolume& volume,
                          const ConfusionModel& confusion) {
  std::vector<std::uint32_t> slots;
  std::size_t voxels = 0;
  for (std::uint32_t slot = 0; slot < volume.slots(); ++slot) {
    if (volume.header(slot).state != BlockState::kVoxels) continue;
    slots.push_back(slot);
    const auto& weights = volume.voxels(slot)->weight;
    voxels += kBlockVoxels - static_cast<std::size_t>(std::ranges::count(weights, 0));
  }
  std::ranges::sort(slots, {}, [&](std::uint32_t slot) { return keyOf(volume.header(slot).index); });
  WholeFile file(path);
  file.write(headOf(voxels));
  std::string points;
  for (const std::uint32_t slot : slots) {
    const VoxelBlock& block = *volume.voxels(slot);
    const LabelBlock* const labels = volume.labels(slot);
    const BlockIndex& index = volume.header(slot).index;
    points.clear();
    for (std::size_t at = 0; at < kBlockVoxels; ++at) {
      if (block.weight[at] == 0) continue;
      const VoxelIndex voxel = voxelOf(index, at);
      for (const std::int32_t along : {voxel.x, voxel.y, voxel.z})
        appendBytes(points, static_cast<float>((along + 0.5) * volume.settings().voxel_size));
      appendBytes(points, volume.distanceStep() * static_cast<float>(block.distance[at]));
      appendBytes(points, static_cast<float>(block.weight[at]) / static_cast<float>(kWeightSteps));
      for (int i = 0; i < 3; ++i) appendBytes(points, block.grey[at]);
      const LabelEstimate label =
          labels != nullptr ? confusion.estimate(labels->counts[at]) : LabelEstimate{};
      appendBytes(points, label.label);
      appendBytes(points, static_cast<std::uint8_t>(std::lround(255 * label.probability)));
    }
    file.write(points);
  }
  file.commit();
  return voxels;
}

}  // namespace swiftlet
