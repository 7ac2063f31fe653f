#pragma once
// Decompresses xz data: pose graphs, ground truth. Host side.

#include <cstddef>
#include <string>
#include <string_view>

namespace swiftlet {

/// Limit of decompressed bytes: a compressed file of a few kilobytes could otherwise fill the memory.
inline constexpr std::size_t kMaxUnpacked = std::size_t{1} << 30U;

/// Whether the bytes are xz data, detected from the first six.
[[nodiscard]] bool isXz(std::string_view bytes);

/// Decompresses consecutive streams. InputError, naming `name`: not a complete xz file, more than `most`
/// bytes, or no memory.
[[nodiscard]] std::string unpackXz(const std::string& name, std::string_view packed,
                                   std::size_t most = kMaxUnpacked);

}  // namespace swiftlet
