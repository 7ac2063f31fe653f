#pragma once
// A file that appears completely or not at all: written to `<path>.part` beside it, synced to the disk
// (fsync), renamed to its name, and the folder synced. If program or machine stop at any time, the name
// refers to the old file or to the new one. For everything that is not a stream.
//
// If the path is a link, its target is replaced and the link stays. Devices and pipes are written directly.
// Threads: one per file. Cost: two waits for the disk at commit(), none with Sync::kNo. Errors: InputError
// with the file, the system's reason and the remedy; the temporary file is removed.

#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

namespace swiftlet {

class WholeFile {
 public:
  /// kNo: renamed without syncing, for the many small files of a sequence. A power cut may lose or empty the
  /// newest ones.
  enum class Sync { kYes, kNo };

  explicit WholeFile(const std::string& path, Sync sync = Sync::kYes);
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;
  /// Without commit(), the new content is discarded and the old file stays.
  ~WholeFile();

  void write(std::string_view bytes);
  /// On return the file has its name.
  void commit();

 private:
  struct Closer {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  [[noreturn]] void fail(int error);

  std::string path_;    ///< as given, for messages
  std::string target_;  ///< with links followed
  std::string part_;    ///< empty: written directly
  Sync sync_;
  std::unique_ptr<std::FILE, Closer> file_;
};

/// Writes the file in one call.
void writeWholeFile(const std::string& path, std::string_view bytes,
                    WholeFile::Sync sync = WholeFile::Sync::kYes);

/// For libraries that write a file by name: syncs `part` to the disk and renames it to `path`. On an error
/// `part` is removed.
void commitPart(const std::string& part, const std::string& path);

}  // namespace swiftlet
