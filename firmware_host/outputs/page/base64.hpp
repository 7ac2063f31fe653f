#pragma once
// Bytes as text (RFC 4648, with padding), for columns and meshes in the report's document.

#include <span>
#include <string>

namespace swiftlet {

std::string base64(std::span<const unsigned char> bytes);

/// Encodes numbers as they are in memory (little-endian).
template <typename T>
std::string base64Of(std::span<const T> values) {
  return base64({reinterpret_cast<const unsigned char*>(values.data()), values.size_bytes()});
}

}  // namespace swiftlet
