#pragma once
// What the program reads packed by xz: pose graphs, ground truth. Host side.

#include <cstddef>
#include <string>
#include <string_view>

namespace swiftlet {

/// Limit of decompressed bytes: a compressed file of a few kilobytes could otherwise fill the memory.
inline constexpr std::size_t kMaxUnpacked = std::size_t{1} << 30U;

/// Whether bytes are compressed by xz, detected from the first six.
[[nodiscard]] bool isXz(std::string_view bytes);

/// Unpacks streams that follow one another. InputError, naming `name`: not a whole xz file, more than
/// `most` bytes, no memory.
[[nodiscard]] std::string unpackXz(const std::string& name, std::string_view packed,
                                   std::size_t most = kMaxUnpacked);

}  // namespace swiftlet
