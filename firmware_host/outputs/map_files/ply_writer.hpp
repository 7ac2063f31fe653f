#pragma once
// What the writers of PLY files share: binary, little-endian.

#include <array>
#include <bit>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "firmware_host/outputs/map_files/ply_header.hpp"

namespace swiftlet {

static_assert(std::endian::native == std::endian::little, "numbers are written as the memory has them");

/// Appends the bytes of a number or of an array of numbers.
template <typename T>
void appendBytes(std::string& to, const T& value) {
  static_assert(std::has_unique_object_representations_v<T> || std::is_floating_point_v<T>);
  to.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

/// Comment in files of the map.
inline constexpr const char* kMapComment = "swiftlet: map axes, z up, metres";

/// Header of a binary file with these elements; `comment` empty: none.
std::string writePlyHeader(const std::vector<PlyElement>& elements, std::string_view comment);

/// Triangles with a label each, as appendFace() writes them: kFaceBytes each.
PlyElement faceElement(std::size_t count);
inline constexpr std::size_t kFaceBytes = 1 + 3 * sizeof(std::int32_t) + 1;
void appendFace(std::string& to, const std::array<std::uint32_t, 3>& corners, std::uint8_t label);

}  // namespace swiftlet
