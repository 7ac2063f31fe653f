#include "firmware_host/files/new_folder.hpp"

#include <utility>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

/// Also for a path that ends with a slash.
fs::path folderOf(const std::string& path) {
  const fs::path folder = fs::path(path).lexically_normal();
  return folder.has_filename() ? folder : folder.parent_path();
}

}  // namespace

void refuseExisting(const std::string& path) {
  std::error_code error;
  if (!fs::exists(folderOf(path), error)) return;
  throw InputError(path, 0, "", "already exists and is never overwritten",
                   "Choose another folder or remove this one");
}

NewFolder::NewFolder(const std::string& path, std::vector<std::string> names)
    : path_(folderOf(path)), part_(path_.string() + ".part"), names_(std::move(names)) {
  refuseExisting(path);
  removeFiles();
  std::error_code error;
  fs::create_directories(part_, error);
  if (error) throw InputError(part_.string(), 0, "", error.message(), "Choose a folder that can be created");
}

NewFolder::~NewFolder() {
  removeFiles();
  std::error_code error;
  fs::remove(part_, error);
}

void NewFolder::removeFiles() const {
  std::error_code error;
  for (const std::string& name : names_) fs::remove(part_ / name, error);
}

void NewFolder::commit() {
  std::error_code error;
  fs::rename(part_, path_, error);
  if (error) {
    throw InputError(path_.string(), 0, "", error.message(), "Choose a folder that does not exist yet");
  }
}

}  // namespace swiftlet
