#pragma once
// The header of a PLY file: which elements with which properties follow, how often, in which encoding.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace swiftlet {

enum class PlyType : std::uint8_t { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

/// Bytes of one value in a binary file.
std::size_t sizeOf(PlyType type);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat;
  bool is_list = false;
  PlyType count_type = PlyType::kUint8;  ///< of a list's length
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  bool binary = false;
  std::vector<PlyElement> elements;
  std::size_t size = 0;  ///< bytes up to the body
  int lines = 0;
};

/// InputError with the line when this is no header, or its counts ask for more than `bytes` can hold.
PlyHeader readPlyHeader(const std::string& name, std::string_view bytes);

}  // namespace swiftlet
