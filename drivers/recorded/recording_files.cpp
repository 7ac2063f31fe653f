#include "drivers/recorded/recording_files.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/recording_format.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kWindowBytes = 1U << 20U;

class SegmentOnDisk final : public RecordingFile {
 public:
  SegmentOnDisk(const fs::path& path, std::uint64_t size) : name_(path.string()), size_(size) {}

  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] std::uint64_t size() const override { return size_; }

  /// Opens the file for each read: a long recording has more segments than a process may have open files, and
  /// opening costs little compared with reading an image.
  std::size_t read(std::uint64_t offset, std::span<std::uint8_t> out) const override {
    const int file = ::open(name_.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) refuse(offset);
    std::size_t done = 0;
    while (done < out.size()) {
      const ssize_t got =
          ::pread(file, out.data() + done, out.size() - done, static_cast<off_t>(offset + done));
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) {
        const int error = errno;
        ::close(file);
        errno = error;
        refuse(offset + done);
      }
      if (got == 0) break;
      done += static_cast<std::size_t>(got);
    }
    ::close(file);
    return done;
  }

 private:
  [[noreturn]] void refuse(std::uint64_t offset) const {
    throw InputError(
        name_, 0, fmt::format("byte {}", offset), fmt::format("cannot be read: {}", std::strerror(errno)),
        "Copy the recording to a working disk, or remove this and the later segments to replay up to here");
  }

  std::string name_;
  std::uint64_t size_;
};

bool hasSegments(const fs::path& folder) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    std::uint32_t segment = 0;
    if (parseSegmentName(entry.path().filename().string(), segment)) return true;
  }
  return false;
}

}  // namespace

std::string findRecordingFolder(const std::string& path) {
  for (const fs::path& folder : {fs::path(path), fs::path(path) / "recording"}) {
    if (hasSegments(folder)) return folder.string();
  }
  return {};
}

RecordingFiles listRecordingFiles(const std::string& folder) {
  std::vector<std::uint32_t> numbers;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    std::uint32_t segment = 0;
    if (parseSegmentName(entry.path().filename().string(), segment)) numbers.push_back(segment);
  }
  std::sort(numbers.begin(), numbers.end());
  RecordingFiles files;
  files.folder = folder;
  for (const std::uint32_t number : numbers) {
    const auto expected = static_cast<std::uint32_t>(files.segments.size());
    const fs::path path = fs::path(folder) / segmentName(number).data();
    if (number != expected) {
      throw InputError((fs::path(folder) / segmentName(expected).data()).string(), 0, "",
                       fmt::format("this segment is missing, but {} exists", path.filename().string()),
                       expected == 0 ? "Restore it: it holds the header of the recording"
                                     : "Restore it, or remove the later segments to replay up to it");
    }
    const std::uintmax_t size = fs::file_size(path, error);
    if (error) {
      throw InputError(path.string(), 0, "", "cannot be read: " + error.message(),
                       "A segment must be a regular file");
    }
    files.segments.push_back(std::make_unique<SegmentOnDisk>(path, size));
  }
  return files;
}

RecordingReadLock::RecordingReadLock(const std::string& folder)
    : folder_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  // Reading continues without a lock if the file system does not support locks.
  if (folder_ < 0 || ::flock(folder_, LOCK_SH | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
  ::close(folder_);
  throw InputError(folder, 0, "", "this recording is still being written",
                   "Wait until that program has ended, or read a copy");
}

RecordingReadLock::~RecordingReadLock() {
  if (folder_ >= 0) ::close(folder_);
}

RecordingWindow::RecordingWindow(const RecordingFile& file)
    : file_(file), bytes_(static_cast<std::size_t>(std::min<std::uint64_t>(kWindowBytes, file.size()))) {}

void RecordingWindow::load(std::uint64_t offset) {
  begin_ = offset;
  held_ = offset < file_.size() ? file_.read(offset, bytes_) : 0;
  // Ignore bytes written after the file was opened.
  held_ =
      static_cast<std::size_t>(std::min<std::uint64_t>(held_, file_.size() - std::min(offset, file_.size())));
}

std::span<const std::uint8_t> RecordingWindow::some(std::uint64_t offset) {
  if (offset < begin_ || offset >= begin_ + held_) load(offset);
  return std::span<const std::uint8_t>(bytes_).subspan(static_cast<std::size_t>(offset - begin_),
                                                       held_ - static_cast<std::size_t>(offset - begin_));
}

std::span<const std::uint8_t> RecordingWindow::exactly(std::uint64_t offset, std::size_t count) {
  if (some(offset).size() < count) load(offset);
  const std::span<const std::uint8_t> held = some(offset);
  return held.first(std::min(held.size(), count));
}

}  // namespace swiftlet
