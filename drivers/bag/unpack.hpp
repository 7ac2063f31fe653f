#pragma once
// Packed bytes of bags: zstd and LZ4 frames.
//
// Errors: false, with nothing promised about `out`; memory grows with what really comes out, so that a
// wrong length in a file costs nothing.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace swiftlet {

enum class Packing : std::uint8_t { kNone, kLz4, kZstd };

/// Unpacks all of `packed`, which must give exactly `size` bytes. False otherwise.
[[nodiscard]] bool unpack(Packing packing, std::span<const std::uint8_t> packed, std::size_t size,
                          std::vector<std::uint8_t>& out);

/// One zstd message of unknown size, at most `most` bytes.
[[nodiscard]] bool unpackZstdMessage(std::span<const std::uint8_t> packed, std::size_t most,
                                     std::vector<std::uint8_t>& out);

/// True if the bytes begin like a zstd frame.
[[nodiscard]] bool isZstd(std::span<const std::uint8_t> bytes);

[[nodiscard]] std::vector<std::uint8_t> packZstd(std::span<const std::uint8_t> bytes);

/// The first bytes of a file that was packed as a whole with zstd, at most `most`; fewer where it is damaged.
[[nodiscard]] std::string unpackedBegin(const std::string& packed, std::size_t most);

/// A file that was packed as a whole, unpacked into the system's folder for temporary files and removed with
/// this object; who has it open may read on. InputError for damage and for a full disk.
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
