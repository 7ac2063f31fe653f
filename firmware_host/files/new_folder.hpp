#pragma once
// A folder that appears completely or not at all: it is filled as `<folder>.part` and renamed.
//
// An existing folder is never overwritten. InputError names the folder, the system's reason and the remedy.

#include <filesystem>
#include <string>
#include <vector>

namespace swiftlet {

/// InputError if there is a file or folder at `path`.
void refuseExisting(const std::string& path);

class NewFolder {
 public:
  /// `names`: all files that may be in the folder. Files of these names left by a killed run are removed.
  NewFolder(const std::string& path, std::vector<std::string> names);
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  /// Removes the files unless commit() was called.
  ~NewFolder();

  /// Path at which to write the file `name`.
  [[nodiscard]] std::string file(const std::string& name) const { return (part_ / name).string(); }
  [[nodiscard]] std::string path() const { return path_.string(); }
  void commit();

 private:
  void removeFiles() const;

  std::filesystem::path path_;
  std::filesystem::path part_;
  std::vector<std::string> names_;
};

}  // namespace swiftlet
