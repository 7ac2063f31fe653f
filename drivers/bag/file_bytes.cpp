#include "drivers/bag/file_bytes.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kWindow = std::size_t{16} << 10U;  // bytes; the message indexes of a chunk fit in it
constexpr std::size_t kMostAtOnce = std::size_t{64} << 20U;  // bytes; definitions of types have some 100 kB

}  // namespace

FileBytes::FileBytes(const std::string& path, std::string name) : name_(std::move(name)) {
  file_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status {};
  if (file_ < 0 || ::fstat(file_, &status) != 0) {
    const int error = errno;
    if (file_ >= 0) ::close(file_);
    throw InputError(name_, 0, "", std::string("cannot be read: ") + std::strerror(error),
                     "Check that it exists and this user can read it");
  }
  size_ = static_cast<std::uint64_t>(status.st_size);
}

FileBytes::~FileBytes() { ::close(file_); }

std::size_t FileBytes::readInto(std::uint64_t offset, std::span<std::uint8_t> out) const {
  std::size_t done = 0;
  while (done < out.size()) {
    const ssize_t got =
        ::pread(file_, out.data() + done, out.size() - done, static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      throw InputError(name_, 0, fmt::format("byte {}", offset + done),
                       std::string("cannot be read: ") + std::strerror(errno),
                       "Copy the file to a working disk");
    }
    if (got == 0) break;
    done += static_cast<std::size_t>(got);
  }
  return done;
}

std::span<const std::uint8_t> FileBytes::at(std::uint64_t offset, std::size_t length) {
  if (offset >= size_) return {};
  length = static_cast<std::size_t>(std::min<std::uint64_t>(length, size_ - offset));
  if (length > kMostAtOnce) {
    throw InputError(name_, 0, fmt::format("byte {}", offset),
                     fmt::format("a record of {} bytes is too large", length),
                     "The file is damaged: copy it again");
  }
  const bool inside = offset >= window_begin_ && offset - window_begin_ + length <= window_size_;
  if (!inside) {
    const std::size_t wanted =
        static_cast<std::size_t>(std::min<std::uint64_t>(std::max(length, kWindow), size_ - offset));
    window_size_ = 0;  // if reading fails, it holds nothing
    if (window_.size() < wanted) window_.resize(wanted);
    window_begin_ = offset;
    window_size_ = readInto(offset, std::span(window_).first(wanted));
  }
  const auto from = static_cast<std::size_t>(offset - window_begin_);
  return std::span<const std::uint8_t>(window_).subspan(from, std::min(length, window_size_ - from));
}

void FileBytes::read(std::uint64_t offset, std::size_t length, std::vector<std::uint8_t>& out) const {
  const std::uint64_t there = offset < size_ ? size_ - offset : 0;
  out.resize(static_cast<std::size_t>(std::min<std::uint64_t>(length, there)));
  out.resize(readInto(offset, out));
}

}  // namespace swiftlet
