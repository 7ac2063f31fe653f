#pragma once
// The decompressed chunks of a bag that were used last: topics recorded together lie in few chunks at a time.

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace swiftlet {

class ChunkCache {
 public:
  /// No chunk's number.
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  /// The chunk's bytes, valid until the next call. Where it is not kept, `fill(bytes)` decompresses it; it
  /// may throw.
  template <typename Fill>
  std::span<const std::uint8_t> at(std::uint32_t chunk, Fill&& fill) {
    ++uses_;
    Kept* oldest = kept_.data();
    for (Kept& kept : kept_) {
      if (kept.chunk == chunk) {
        kept.used = uses_;
        return kept.bytes;
      }
      if (kept.used < oldest->used) oldest = &kept;
    }
    oldest->chunk = kNone;
    fill(oldest->bytes);
    oldest->chunk = chunk;
    oldest->used = uses_;
    return oldest->bytes;
  }

 private:
  static constexpr std::size_t kChunks = 4;

  struct Kept {
    std::uint32_t chunk = kNone;
    std::uint64_t used = 0;  ///< number of the last use
    std::vector<std::uint8_t> bytes;
  };

  std::array<Kept, kChunks> kept_;
  std::uint64_t uses_ = 0;
};

}  // namespace swiftlet
