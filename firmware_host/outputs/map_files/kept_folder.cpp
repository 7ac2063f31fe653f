#include "firmware_host/outputs/map_files/kept_folder.hpp"

#include "drivers/calibration/input_error.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/outputs/map_files/kept_graph_file.hpp"
#include "firmware_host/outputs/map_files/kept_map.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

/// With a slash at its end too.
fs::path folderOf(const std::string& path) {
  const fs::path folder = fs::path(path).lexically_normal();
  return folder.has_filename() ? folder : folder.parent_path();
}

}  // namespace

KeptFolder::KeptFolder(const std::string& path) : path_(folderOf(path)), part_(path_.string() + ".part") {
  std::error_code error;
  if (fs::exists(path_, error)) {
    throw InputError(path, 0, "", "is there already; a kept map is never written over",
                     "Name another folder, or remove this one");
  }
  fs::remove(part_ / kKeptGraphFile, error);
  fs::remove(part_ / kKeptVolumeFile, error);
  fs::create_directories(part_, error);
  if (error) throw InputError(part_.string(), 0, "", error.message(), "Name a folder that can be made");
}

KeptFolder::~KeptFolder() {
  std::error_code error;
  fs::remove(part_ / kKeptGraphFile, error);
  fs::remove(part_ / kKeptVolumeFile, error);
  fs::remove(part_, error);
}

void KeptFolder::write(const KeptGraph& graph) {
  const std::vector<std::uint8_t> bytes = keptGraphBytes(graph);
  writeWholeFile((part_ / kKeptGraphFile).string(),
                 {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  has_graph_ = true;
}

void KeptFolder::write(MapStage& map, const std::function<bool(std::uint32_t epoch)>& wanted) {
  writeKeptMapFile((part_ / kKeptVolumeFile).string(), map, wanted);
}

void KeptFolder::commit() {
  if (!has_graph_) {
    throw InputError(path_.string(), 0, "", "no map was written: loop closure did not finish",
                     "Repeat the run");
  }
  std::error_code error;
  fs::rename(part_, path_, error);
  if (error) {
    throw InputError(path_.string(), 0, "", error.message(), "Name a folder that is not there yet");
  }
}

KeptGraph readKeptFolder(const std::string& path) {
  return readKeptGraphFile((folderOf(path) / kKeptGraphFile).string());
}

}  // namespace swiftlet
