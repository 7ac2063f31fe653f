#pragma once
// The header of a PLY file: elements, their properties, their counts, and the encoding.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace swiftlet {

enum class PlyType : std::uint8_t { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

/// Returns `with` applied to a number of this type.
template <typename With>
auto withNumber(PlyType type, const With& with) {
  switch (type) {
    case PlyType::kInt8:
      return with(std::int8_t{});
    case PlyType::kUint8:
      return with(std::uint8_t{});
    case PlyType::kInt16:
      return with(std::int16_t{});
    case PlyType::kUint16:
      return with(std::uint16_t{});
    case PlyType::kInt32:
      return with(std::int32_t{});
    case PlyType::kUint32:
      return with(std::uint32_t{});
    case PlyType::kFloat:
      return with(float{});
    case PlyType::kDouble:
      break;
  }
  return with(double{});
}

/// Bytes of one value in a binary file.
std::size_t sizeOf(PlyType type);
/// As in a header: uchar, float.
std::string_view nameOf(PlyType type);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat;
  bool is_list = false;
  PlyType count_type = PlyType::kUint8;  ///< type of a list's length
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  bool binary = false;
  std::vector<PlyElement> elements;
  std::size_t size = 0;  ///< bytes before the body
  int lines = 0;
};

/// InputError with the line if this is not a header, or if its counts need more than `bytes`.
PlyHeader readPlyHeader(const std::string& name, std::string_view bytes);

}  // namespace swiftlet
