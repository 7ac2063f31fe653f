#pragma once
// A kept map as a folder: graph.swg (kept_graph_file.hpp) and, where a volume was fused, volume.swm
// (kept_map.hpp). The folder is there as a whole or not at all: it is filled as `<folder>.part` and renamed.

#include <filesystem>
#include <functional>
#include <string>

#include "mapping/loop/kept_graph.hpp"
#include "mapping/map/map_stage.hpp"

namespace swiftlet {

inline constexpr const char* kKeptGraphFile = "graph.swg";
inline constexpr const char* kKeptVolumeFile = "volume.swm";

class KeptFolder {
 public:
  /// InputError where there is something of that name already, or nothing can be made there.
  explicit KeptFolder(const std::string& path);
  KeptFolder(const KeptFolder&) = delete;
  KeptFolder& operator=(const KeptFolder&) = delete;
  /// Without commit() before, what was written goes.
  ~KeptFolder();

  /// InputError where they cannot be written.
  void write(const KeptGraph& graph);
  void write(MapStage& map, const std::function<bool(std::uint32_t epoch)>& wanted);
  /// Also where no graph was written.
  void commit();

 private:
  std::filesystem::path path_;
  std::filesystem::path part_;
  bool has_graph_ = false;
};

/// InputError where the folder holds no sound graph.
KeptGraph readKeptFolder(const std::string& path);

}  // namespace swiftlet
