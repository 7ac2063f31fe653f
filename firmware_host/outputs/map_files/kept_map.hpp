#pragma once
// A map on disk: writing, reading, continuing. docs/formats.md has the layout.
//
// The file keeps the volume's blocks bit by bit (distances, weights, grey values, label counts, free space),
// the epoch and the vehicle's last position. The same map gives the same bytes. Blocks are ordered by their
// distance from the vehicle, so that a smaller pool takes the nearest; the rest goes to the map's storage.
// Every record has a CRC. A file is read twice, first only to check it, so that nothing is loaded from a
// damaged one. Memory: one record, and for writing 12 bytes per block. InputError names the file, the byte,
// the field and the remedy.

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <span>
#include <string>

#include "mapping/map/map_stage.hpp"

namespace swiftlet {

struct KeptMapCounts {
  std::uint32_t blocks = 0;  ///< blocks with voxels
  std::uint32_t free_blocks = 0;
};

struct KeptMapReport {
  KeptMapCounts held;          ///< in the file
  KeptMapCounts without_room;  ///< of these, not loaded because the receiving map is smaller
  std::uint32_t epoch = 0;
  Eigen::Vector3d p_map_vehicle = Eigen::Vector3d::Zero();
};

/// The parts of a map that are kept.
struct MapParts {
  const VoxelVolume& volume;
  double least_weight = SurfaceSettings{}.least_weight;  ///< of the surface
  std::uint32_t epoch = 0;
  Eigen::Vector3d p_map_vehicle = Eigen::Vector3d::Zero();
};

KeptMapCounts writeKeptMap(const std::string& name, std::ostream& out, const MapParts& map);
/// Writes to a temporary file beside `path` and renames it: an older file stays intact until then.
KeptMapCounts writeKeptMapFile(const std::string& path, const MapParts& map);
/// Writes all blocks of the epochs for which `wanted` holds, at their current place (MapStage::wholeVolume).
KeptMapCounts writeKeptMapFile(const std::string& path, MapStage& map,
                               const std::function<bool(std::uint32_t epoch)>& wanted);

/// Checks all of `in` for a map with `settings`; throws if anything is wrong.
KeptMapReport checkKeptMap(const std::string& name, std::istream& in, const VolumeSettings& settings);
/// Call after checkKeptMap(): loads into an empty volume; blocks without room go to `submaps` (may be null).
/// If it throws (the file has changed since), volume and submaps hold a part.
void loadKeptMap(const std::string& name, std::istream& in, VoxelVolume& volume, MapSubmaps* submaps,
                 KeptMapReport& report);
/// Replaces the content of `map`. If it throws, the map is unchanged, or empty if the file changed meanwhile.
KeptMapReport readKeptMap(const std::string& name, std::istream& in, MapStage& map);
KeptMapReport readKeptMapFile(const std::string& path, MapStage& map);

/// Checks the whole file for a map with `settings`; throws if anything is wrong.
void checkKeptMapFile(const std::string& path, const VolumeSettings& settings);
/// Call after checkKeptMapFile(): loads the map as submaps that move with the nodes of its graph
/// (KeptSubmaps). If it throws (the file has changed since, or `to` cannot store everything), `to` holds a
/// part.
void readKeptSubmaps(const std::string& path, MapSubmaps& to, std::span<const WorldInMap> nodes);

/// Settings with which the map was kept.
struct KeptMapSettings {
  VolumeSettings volume;    ///< memory: as much as the whole map needs
  double least_weight = 0;  ///< of the surface
};
/// Throws if the file is missing or its head is damaged.
KeptMapSettings keptMapSettings(const std::string& path);
/// The volume of a kept map alone, for inspection without continuing the map. Throws if the file is missing
/// or damaged.
VoxelVolume readKeptVolumeFile(const std::string& path);

}  // namespace swiftlet
