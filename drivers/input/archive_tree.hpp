#pragma once
// The archives of file_tree.hpp.

#include <map>
#include <set>

#include "drivers/input/file_tree.hpp"

struct archive;

namespace swiftlet {

class ArchiveTree final : public FileTree {
 public:
  /// InputError: not an archive, damaged, or more than kMostText of text.
  explicit ArchiveTree(const std::string& path);

  [[nodiscard]] bool isFile(const std::string& path) const override { return files_.contains(path); }
  [[nodiscard]] bool isFolder(const std::string& path) const override { return folders_.contains(path); }
  [[nodiscard]] std::vector<std::string> list(const std::string& folder) const override;
  [[nodiscard]] bool read(const std::string& path, std::vector<std::uint8_t>& bytes) override;

 private:
  struct Closer {
    void operator()(archive* handle) const;
  };
  using Handle = std::unique_ptr<archive, Closer>;
  using Bytes = std::vector<std::uint8_t>;

  /// A reader of the archive, from its start.
  struct Reader {
    Handle handle;
    std::size_t next = 0;  ///< number of its next entry
  };

  [[nodiscard]] Handle open() const;
  void index();
  void add(const std::string& path, std::size_t number);
  /// Moves `reader` to the entry and reads it; keeps passed entries of the same folder.
  bool readAt(Reader& reader, const std::string& folder, std::size_t number, Bytes& bytes);
  void keep(std::size_t number, Bytes bytes);

  std::string path_;
  std::map<std::string, std::size_t> files_;              ///< numbers of entries
  std::map<std::string, std::set<std::string>> folders_;  ///< names in each
  std::map<std::size_t, Bytes> texts_;
  std::map<std::size_t, Bytes> kept_;
  std::size_t kept_bytes_ = 0;
  std::map<std::string, Reader> readers_;  ///< by folder
};

}  // namespace swiftlet
