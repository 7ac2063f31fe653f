#pragma once
// Random access to the bytes of a file through a small window, so that consecutive records need few reads.
//
// Errors: InputError if the file cannot be opened or read, and from at() for more than 64 MiB. A request
// beyond the end returns only the bytes that exist.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace swiftlet {

class FileBytes {
 public:
  /// `name` names the file in messages.
  FileBytes(const std::string& path, std::string name);
  FileBytes(const FileBytes&) = delete;
  FileBytes& operator=(const FileBytes&) = delete;
  ~FileBytes();

  [[nodiscard]] std::uint64_t size() const { return size_; }
  /// Returns at most `length` bytes from `offset`, valid until the next call.
  std::span<const std::uint8_t> at(std::uint64_t offset, std::size_t length);
  /// Like at(), but without the copy into the window; for large reads.
  void read(std::uint64_t offset, std::size_t length, std::vector<std::uint8_t>& out) const;

 private:
  std::size_t readInto(std::uint64_t offset, std::span<std::uint8_t> out) const;

  std::string name_;
  int file_ = -1;
  std::uint64_t size_ = 0;
  std::vector<std::uint8_t> window_;
  std::uint64_t window_begin_ = 0;
  std::size_t window_size_ = 0;
};

}  // namespace swiftlet
