#include "drivers/input/file_tree.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "drivers/input/archive_tree.hpp"
#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

class DiskTree final : public FileTree {
 public:
  explicit DiskTree(const std::string& root) : FileTree(root), root_(root.empty() ? "." : root) {}

  [[nodiscard]] bool isFile(const std::string& path) const override {
    std::error_code none;
    return fs::is_regular_file(root_ / path, none);
  }
  [[nodiscard]] bool isFolder(const std::string& path) const override {
    std::error_code none;
    return fs::is_directory(root_ / path, none);
  }
  [[nodiscard]] std::vector<std::string> list(const std::string& folder) const override {
    std::vector<std::string> names;
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(root_ / folder, none)) {
      names.push_back(entry.path().filename().string());
    }
    std::ranges::sort(names);
    return names;
  }
  [[nodiscard]] bool read(const std::string& path, std::vector<std::uint8_t>& bytes) override;

 private:
  fs::path root_;
};

bool DiskTree::read(const std::string& path, std::vector<std::uint8_t>& bytes) {
  bytes.clear();
  const int file = ::open((root_ / path).c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return false;
  struct stat status {};
  bool good = ::fstat(file, &status) == 0 && S_ISREG(status.st_mode) &&
              static_cast<std::size_t>(status.st_size) <= kLargestFile;
  bytes.resize(good ? static_cast<std::size_t>(status.st_size) : 0);
  std::size_t done = 0;
  while (good && done < bytes.size()) {
    const ssize_t got = ::read(file, bytes.data() + done, bytes.size() - done);
    good = got > 0;
    if (good) done += static_cast<std::size_t>(got);
  }
  ::close(file);
  bytes.resize(done);
  return good;
}

}  // namespace

std::string FileTree::name(const std::string& path) const {
  return path.empty() ? root_ : (fs::path(root_) / path).string();
}

std::string FileTree::text(const std::string& path) {
  std::vector<std::uint8_t> bytes;
  if (!read(path, bytes))
    throw InputError(name(path), 0, "", "cannot be read", "Check that it exists and this user can read it");
  return {bytes.begin(), bytes.end()};
}

std::shared_ptr<FileTree> openFolder(const std::string& path) { return std::make_shared<DiskTree>(path); }

std::shared_ptr<FileTree> openArchive(const std::string& path) { return std::make_shared<ArchiveTree>(path); }

}  // namespace swiftlet
