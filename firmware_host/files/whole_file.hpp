#pragma once
// A file that is there as a whole or not at all: written to `<path>.part` beside it, brought to the disk
// (fsync), renamed to its name, and the folder brought to the disk. Whatever stops the program or the machine
// leaves the older file under that name, or the new one. For everything that is not a stream.
//
// A link leads to the file that is replaced; the link stays. Devices and pipes are written as they are.
// Threads: one per file. Cost: two waits for the disk at commit(), none with Sync::kNo.
// Errors: InputError with the file, the system's reason and the remedy; the temporary file is removed.

#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

namespace swiftlet {

class WholeFile {
 public:
  /// kNo: renamed only, for the many small files of a sequence. A power cut may lose or empty the newest.
  enum class Sync { kYes, kNo };

  explicit WholeFile(const std::string& path, Sync sync = Sync::kYes);
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;
  /// Without a previous commit() the new content is discarded and the old file stays.
  ~WholeFile();

  void write(std::string_view bytes);
  /// The file has its name when this returns.
  void commit();

 private:
  struct Closer {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  [[noreturn]] void fail(int error);

  std::string path_;    ///< as given, for messages
  std::string target_;  ///< with links followed
  std::string part_;    ///< empty: written as it is
  Sync sync_;
  std::unique_ptr<std::FILE, Closer> file_;
};

/// All of it in one call.
void writeWholeFile(const std::string& path, std::string_view bytes,
                    WholeFile::Sync sync = WholeFile::Sync::kYes);

/// For a library that writes a file by its name: brings `part` to the disk and gives it the name `path`.
/// On an error `part` is removed.
void commitPart(const std::string& part, const std::string& path);

}  // namespace swiftlet
