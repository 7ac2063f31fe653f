#pragma once
// Decompresses zstd, LZ4 and bzip2 data of bags.
//
// Errors: false, and `out` is then unspecified. Memory grows with the actual output, so a wrong length in a
// file allocates nothing.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace swiftlet {

enum class Packing : std::uint8_t { kNone, kLz4, kZstd, kBz2 };

constexpr std::uint64_t kMostUnpacked = std::uint64_t{1}
                                        << 30U;  // bytes per chunk; recorders make 1 to 4 MiB

/// Decompresses all of `packed`; false unless it is compressed and the result has exactly `size` bytes.
[[nodiscard]] bool unpack(Packing packing, std::span<const std::uint8_t> packed, std::size_t size,
                          std::vector<std::uint8_t>& out);

/// Decompresses one zstd message of unknown size, at most `most` bytes.
[[nodiscard]] bool unpackZstd(std::span<const std::uint8_t> packed, std::size_t most,
                              std::vector<std::uint8_t>& out);

/// True if the bytes start like a zstd frame.
[[nodiscard]] bool isZstd(std::span<const std::uint8_t> bytes);

[[nodiscard]] std::vector<std::uint8_t> packZstd(std::span<const std::uint8_t> bytes);

/// At most the first `most` bytes of a file compressed as a whole with zstd; fewer if it is damaged.
[[nodiscard]] std::string unpackedBegin(const std::string& packed, std::size_t most);

/// A file compressed as a whole, decompressed into the system's temporary folder and removed with this
/// object; files opened before stay readable. InputError for damage and for a full disk.
class UnpackedFile {
 public:
  explicit UnpackedFile(const std::string& packed);
  UnpackedFile(const UnpackedFile&) = delete;
  UnpackedFile& operator=(const UnpackedFile&) = delete;
  ~UnpackedFile();
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace swiftlet
