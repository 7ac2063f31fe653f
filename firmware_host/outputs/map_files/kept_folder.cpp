#include "firmware_host/outputs/map_files/kept_folder.hpp"

#include "drivers/input/input_error.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/outputs/map_files/kept_graph_file.hpp"
#include "firmware_host/outputs/map_files/kept_map.hpp"

namespace swiftlet {

namespace fs = std::filesystem;

void KeptFolder::write(const KeptGraph& graph) {
  const std::vector<std::uint8_t> bytes = keptGraphBytes(graph);
  writeWholeFile(folder_.file(kKeptGraphFile), {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  has_graph_ = true;
}

void KeptFolder::write(MapStage& map, const std::function<bool(std::uint32_t epoch)>& wanted) {
  writeKeptMapFile(folder_.file(kKeptVolumeFile), map, wanted);
}

void KeptFolder::write(const VoxelVolume& volume, double least_weight) {
  writeKeptMapFile(folder_.file(kKeptVolumeFile), {volume, least_weight});
}

void KeptFolder::commit() {
  if (!has_graph_) {
    throw InputError(folder_.path(), 0, "", "no map was written: loop closure did not finish",
                     "Repeat the run");
  }
  folder_.commit();
}

KeptGraph readKeptFolder(const std::string& path) {
  return readKeptGraphFile((fs::path(path) / kKeptGraphFile).string());
}

std::string keptVolumeOf(const std::string& path) {
  std::error_code none;
  return fs::is_directory(path, none) ? (fs::path(path) / kKeptVolumeFile).string() : path;
}

}  // namespace swiftlet
