#pragma once
// A folder that is there as a whole or not at all: it is filled as `<folder>.part` and renamed.
//
// One that is there already is never written over. InputError names the folder, the system's reason and the
// remedy.

#include <filesystem>
#include <string>
#include <vector>

namespace swiftlet {

class NewFolder {
 public:
  /// `names`: of all the files that may be in it. What a run that was killed left of them goes.
  NewFolder(const std::string& path, std::vector<std::string> names);
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  /// Without commit() before, the files go.
  ~NewFolder();

  /// Where to write one of the names to.
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
