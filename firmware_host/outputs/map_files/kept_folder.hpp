#pragma once
// A kept map as a folder: graph.swg (kept_graph_file.hpp) and, if a volume was fused, volume.swm
// (kept_map.hpp). The folder appears completely or not at all (new_folder.hpp).

#include <functional>
#include <string>

#include "firmware_host/files/new_folder.hpp"
#include "mapping/loop/kept_graph.hpp"
#include "mapping/map/map_stage.hpp"

namespace swiftlet {

inline constexpr const char* kKeptGraphFile = "graph.swg";
inline constexpr const char* kKeptVolumeFile = "volume.swm";

class KeptFolder {
 public:
  /// InputError if `path` already exists or cannot be created.
  explicit KeptFolder(const std::string& path) : folder_(path, {kKeptGraphFile, kKeptVolumeFile}) {}

  /// InputError if the data cannot be written.
  void write(const KeptGraph& graph);
  void write(MapStage& map, const std::function<bool(std::uint32_t epoch)>& wanted);
  void write(const VoxelVolume& volume, double least_weight);
  /// Folder for unnamed temporary files while the map is being written.
  [[nodiscard]] std::string folder() const { return folder_.file(""); }
  /// Makes the folder appear under its name, even if no graph was written.
  void commit();

 private:
  NewFolder folder_;
  bool has_graph_ = false;
};

/// InputError if the folder holds no valid graph.
KeptGraph readKeptFolder(const std::string& path);

/// The volume file of a kept map: `path` itself, or the file in the folder `path`.
std::string keptVolumeOf(const std::string& path);

}  // namespace swiftlet
