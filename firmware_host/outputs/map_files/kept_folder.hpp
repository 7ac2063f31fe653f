#pragma once
// A kept map as a folder: graph.swg (kept_graph_file.hpp) and, where a volume was fused, volume.swm
// (kept_map.hpp). The folder is there as a whole or not at all (new_folder.hpp).

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
  /// InputError if there is something of that name already, or nothing can be made there.
  explicit KeptFolder(const std::string& path) : folder_(path, {kKeptGraphFile, kKeptVolumeFile}) {}

  /// InputError if they cannot be written.
  void write(const KeptGraph& graph);
  void write(MapStage& map, const std::function<bool(std::uint32_t epoch)>& wanted);
  void write(const VoxelVolume& volume, double least_weight);
  /// For files without a name while it is filled.
  [[nodiscard]] std::string folder() const { return folder_.file(""); }
  /// Also where no graph was written.
  void commit();

 private:
  NewFolder folder_;
  bool has_graph_ = false;
};

/// InputError if the folder holds no sound graph.
KeptGraph readKeptFolder(const std::string& path);

/// The volume of a kept map: `path` itself, or in the folder of that name.
std::string keptVolumeOf(const std::string& path);

}  // namespace swiftlet
