#pragma once
// Access to the files of a log, in a folder or in an archive that is not unpacked.
//
// Archives: zip, tar (also compressed by gzip, bzip2, xz, zstd or lz4), 7z and everything else that
// libarchive recognizes by content. Opening reads through the archive once and keeps its texts (all files
// that are not images) in memory. An image is read on request, by a separate reader for each folder, so
// folders that are read in the archive's order cost one pass each. Images that a reader passes are kept, up
// to kMostKept bytes; beyond that, a later request costs another pass. Paths: from the root, with '/' between
// names; "" is the root. Threads: one. Errors: InputError if a file cannot be opened or is damaged as a
// whole. Memory: none for a folder; for an archive its texts (kMostText), some 150 bytes per file, and
// kMostKept.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace swiftlet {

class FileTree {
 public:
  static constexpr std::size_t kMostText = std::size_t{1} << 30U;
  static constexpr std::size_t kMostKept = std::size_t{256} << 20U;
  static constexpr std::size_t kLargestFile = std::size_t{256}
                                              << 20U;  ///< bytes; a larger file of a log is damage

  FileTree(const FileTree&) = delete;
  FileTree& operator=(const FileTree&) = delete;
  virtual ~FileTree() = default;

  [[nodiscard]] virtual bool isFile(const std::string& path) const = 0;
  [[nodiscard]] virtual bool isFolder(const std::string& path) const = 0;
  /// Names in a folder, sorted; empty if there is none.
  [[nodiscard]] virtual std::vector<std::string> list(const std::string& folder) const = 0;
  /// Reads into `bytes`, whose memory is reused. False: missing, too large or damaged.
  [[nodiscard]] virtual bool read(const std::string& path, std::vector<std::uint8_t>& bytes) = 0;

  /// The file as text; InputError if it cannot be read.
  [[nodiscard]] std::string text(const std::string& path);
  /// Path for messages.
  [[nodiscard]] std::string name(const std::string& path) const;

 protected:
  explicit FileTree(std::string root) : root_(std::move(root)) {}

 private:
  std::string root_;
};

/// Whether a file is an archive, detected by content.
[[nodiscard]] bool isArchive(const std::string& path);

[[nodiscard]] std::shared_ptr<FileTree> openArchive(const std::string& path);
/// "": the current directory.
[[nodiscard]] std::shared_ptr<FileTree> openFolder(const std::string& path);

}  // namespace swiftlet
