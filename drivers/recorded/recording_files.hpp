#pragma once
// The segments of a recording as bytes: files of a folder, or memory in tests. Host side: allocates and
// throws InputError.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace swiftlet {

class RecordingFile {
 public:
  RecordingFile() = default;
  RecordingFile(const RecordingFile&) = delete;
  RecordingFile& operator=(const RecordingFile&) = delete;
  virtual ~RecordingFile() = default;

  [[nodiscard]] virtual const std::string& name() const = 0;  ///< for messages
  [[nodiscard]] virtual std::uint64_t size() const = 0;       ///< bytes, as found when it was opened
  /// Reads up to out.size() bytes from `offset` on; fewer only at the end. InputError if the disk fails.
  virtual std::size_t read(std::uint64_t offset, std::span<std::uint8_t> out) const = 0;
};

/// All segments, in order of their numbers.
struct RecordingFiles {
  std::string folder;  ///< for messages
  std::vector<std::unique_ptr<RecordingFile>> segments;
};

/// The folder with the segments: `path` itself or its subfolder `recording`; empty if neither has any.
std::string findRecordingFolder(const std::string& path);

/// InputError if a segment between others is missing.
RecordingFiles listRecordingFiles(const std::string& folder);

/// While this exists no writer can start a new recording in the folder. InputError if one is being written.
class RecordingReadLock {
 public:
  explicit RecordingReadLock(const std::string& folder);
  RecordingReadLock(const RecordingReadLock&) = delete;
  RecordingReadLock& operator=(const RecordingReadLock&) = delete;
  ~RecordingReadLock();

 private:
  int folder_ = -1;
};

/// Reads one file through a window, so that records of any size can be processed.
class RecordingWindow {
 public:
  explicit RecordingWindow(const RecordingFile& file);
  /// The bytes from `offset` that the window holds: at least one before the end of the file, none after it.
  std::span<const std::uint8_t> some(std::uint64_t offset);
  /// The next `count` bytes (a few KiB at most); fewer at the end of the file.
  std::span<const std::uint8_t> exactly(std::uint64_t offset, std::size_t count);
  [[nodiscard]] const RecordingFile& file() const { return file_; }

 private:
  void load(std::uint64_t offset);

  const RecordingFile& file_;
  std::vector<std::uint8_t> bytes_;
  std::uint64_t begin_ = 0;
  std::size_t held_ = 0;
};

}  // namespace swiftlet
