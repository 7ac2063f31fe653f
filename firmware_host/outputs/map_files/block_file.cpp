#include "firmware_host/outputs/map_files/block_file.hpp"

#include <fcntl.h>
#include <unistd.h>

namespace swiftlet {

BlockFile::~BlockFile() {
  if (file_ >= 0) close(file_);
}

bool BlockFile::open() {
  if (file_ >= 0 || failed_) return !failed_;
  const std::string path = folder_ + "/blocks.tmp";
  file_ = folder_.empty() ? -1 : ::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  failed_ = file_ < 0;
  if (!failed_) unlink(path.c_str());
  return !failed_;
}

bool BlockFile::write(std::uint64_t offset, std::span<const std::byte> bytes) {
  return open() && pwrite(file_, bytes.data(), bytes.size(), static_cast<off_t>(offset)) ==
                       static_cast<ssize_t>(bytes.size());
}

bool BlockFile::read(std::uint64_t offset, std::span<std::byte> bytes) {
  return file_ >= 0 && pread(file_, bytes.data(), bytes.size(), static_cast<off_t>(offset)) ==
                           static_cast<ssize_t>(bytes.size());
}

}  // namespace swiftlet
