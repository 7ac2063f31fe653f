#pragma once
// A map on disk: written, read, continued. docs/formats.md has the layout.
//
// Kept are the volume's blocks bit by bit (distances, weights, grey values, label counts, what is free), the
// epoch and where the vehicle was last. The same map gives the same bytes. Blocks lie in order of their
// distance from the vehicle, so that a smaller pool takes the nearest: what has no room goes to the map's
// storage. Every record has a CRC; a file is read twice, first only to check it, so that nothing is loaded
// from a damaged one. Memory: one record and 12 bytes a block for writing. InputError names the file, the
// byte, the field and the remedy.

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <span>
#include <string>

#include "mapping/map/map_stage.hpp"

namespace swiftlet {

struct KeptMapCounts {
  std::uint32_t blocks = 0;  ///< with voxels
  std::uint32_t free_blocks = 0;
};

struct KeptMapReport {
  KeptMapCounts held;          ///< by the file
  KeptMapCounts without_room;  ///< of them, left out: the map that took the others is smaller
  std::uint32_t epoch = 0;
  Eigen::Vector3d p_map_vehicle = Eigen::Vector3d::Zero();
};

/// What is kept of a map.
struct MapParts {
  const VoxelVolume& volume;
  double least_weight = SurfaceSettings{}.least_weight;  ///< of its surface
  std::uint32_t epoch = 0;
  Eigen::Vector3d p_map_vehicle = Eigen::Vector3d::Zero();
};

KeptMapCounts writeKeptMap(const std::string& name, std::ostream& out, const MapParts& map);
/// Written beside `path` and renamed: an older file is whole until the new one is.
KeptMapCounts writeKeptMapFile(const std::string& path, const MapParts& map);
/// All of the epochs for which `wanted` holds, where it belongs by now (MapStage::wholeVolume).
KeptMapCounts writeKeptMapFile(const std::string& path, MapStage& map,
                               const std::function<bool(std::uint32_t epoch)>& wanted);

/// Checks the whole of `in` for a map with `settings`; throws where anything is amiss.
KeptMapReport checkKeptMap(const std::string& name, std::istream& in, const VolumeSettings& settings);
/// Puts it into an empty volume, blocks without room into `submaps` (may be null), after checkKeptMap().
/// Where it throws (the file changed since) both hold a part.
void loadKeptMap(const std::string& name, std::istream& in, VoxelVolume& volume, MapSubmaps* submaps,
                 KeptMapReport& report);
/// In place of what `map` holds. Where it throws the map is as it was; empty if the file changed
/// meanwhile.
KeptMapReport readKeptMap(const std::string& name, std::istream& in, MapStage& map);
KeptMapReport readKeptMapFile(const std::string& path, MapStage& map);

/// As submaps that go with the nodes of its graph (KeptSubmaps). Throws too where `to` cannot store all of
/// it; then `to` holds a part.
void readKeptSubmaps(const std::string& path, MapSubmaps& to, std::span<const WorldInMap> nodes);

/// With what the map was kept.
struct KeptMapSettings {
  VolumeSettings volume;    ///< in as much memory as the whole of it takes
  double least_weight = 0;  ///< of the surface
};
/// Throws for a file that is missing, or whose head is damaged.
KeptMapSettings keptMapSettings(const std::string& path);
/// The volume of a kept map alone, for who looks at it and does not go on with it. Throws for a file that is
/// missing or damaged.
VoxelVolume readKeptVolumeFile(const std::string& path);

}  // namespace swiftlet
