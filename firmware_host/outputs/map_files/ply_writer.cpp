#include "firmware_host/outputs/map_files/ply_writer.hpp"

#include <fmt/format.h>

namespace swiftlet {

std::string writePlyHeader(const std::vector<PlyElement>& elements, std::string_view comment) {
  std::string text = "ply\nformat binary_little_endian 1.0\n";
  if (!comment.empty()) text += fmt::format("comment {}\n", comment);
  for (const PlyElement& element : elements) {
    text += fmt::format("element {} {}\n", element.name, element.count);
    for (const PlyProperty& property : element.properties) {
      const std::string list = property.is_list ? fmt::format("list {} ", nameOf(property.count_type)) : "";
      text += fmt::format("property {}{} {}\n", list, nameOf(property.type), property.name);
    }
  }
  return text + "end_header\n";
}

PlyElement faceElement(std::size_t count) {
  return {"face", count, {{"vertex_indices", PlyType::kInt32, true}, {"label", PlyType::kUint8}}};
}

void appendFace(std::string& to, const std::array<std::uint32_t, 3>& corners, std::uint8_t label) {
  appendBytes(to, static_cast<std::uint8_t>(corners.size()));
  for (const std::uint32_t corner : corners) appendBytes(to, static_cast<std::int32_t>(corner));
  appendBytes(to, label);
}

}  // namespace swiftlet
