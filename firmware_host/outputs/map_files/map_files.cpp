#include "firmware_host/outputs/map_files/map_files.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "drivers/input/input_error.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/outputs/map_files/ply_writer.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

void append(std::string& to, const Eigen::Vector3f& p) {
  for (const float x : p) appendBytes(to, x);
}

/// Fills up to the next multiple of `to`.
void pad(std::string& bytes, std::size_t to, char with) {
  bytes.resize((bytes.size() + to - 1) / to * to, with);
}

void writeAll(const std::string& path, const std::string& head, const std::string& body) {
  WholeFile file(path);
  file.write(head);
  file.write(body);
  file.commit();
}

constexpr std::uint32_t kGlbMagic = 0x46546C67;
constexpr std::uint32_t kGlbVersion = 2;
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
constexpr std::uint32_t kBinaryChunk = 0x004E4942;
constexpr std::size_t kChunkAlignment = 4;
// Component types of the glTF specification.
constexpr int kFloat = 5126;
constexpr int kUnsignedInt = 5125;
constexpr int kUnsignedByte = 5121;
constexpr int kVertexBuffer = 34962;
constexpr int kIndexBuffer = 34963;
constexpr int kTriangles = 4;

/// Writes the JSON and, unless it is empty, the binary chunk.
void writeGlb(const std::string& path, const Json& json, const std::string& binary) {
  std::string text = json.dump();
  pad(text, kChunkAlignment, ' ');
  constexpr std::size_t kFileHead = 12;
  constexpr std::size_t kChunkHead = 8;
  const std::size_t total =
      kFileHead + kChunkHead + text.size() + (binary.empty() ? 0 : kChunkHead + binary.size());
  if (total > std::numeric_limits<std::uint32_t>::max()) {
    throw InputError(path, 0, "", "the map exceeds the 4 GiB of a .glb file", "Use map.ply");
  }
  std::string head;
  for (const std::uint32_t word : {kGlbMagic, kGlbVersion, static_cast<std::uint32_t>(total),
                                   static_cast<std::uint32_t>(text.size()), kJsonChunk}) {
    appendBytes(head, word);
  }
  head += text;
  if (!binary.empty()) {
    appendBytes(head, static_cast<std::uint32_t>(binary.size()));
    appendBytes(head, kBinaryChunk);
  }
  writeAll(path, head, binary);
}

/// Collects the binary chunk and the JSON that describes it.
class GlbBuilder {
 public:
  template <typename AddAll>
  int accessor(std::size_t count, int component, const char* type, bool normalized, int target,
               const AddAll& add) {
    const std::size_t begin = binary_.size();
    add(binary_);
    views_.push_back(
        {{"buffer", 0}, {"byteOffset", begin}, {"byteLength", binary_.size() - begin}, {"target", target}});
    Json accessor = {
        {"bufferView", views_.size() - 1}, {"componentType", component}, {"count", count}, {"type", type}};
    if (normalized) accessor["normalized"] = true;
    accessors_.push_back(accessor);
    pad(binary_, kChunkAlignment, 0);
    return static_cast<int>(accessors_.size()) - 1;
  }
  Json& last() { return accessors_.back(); }

  void write(const std::string& path, const Json& primitive) {
    // The map has z up, glTF has y up: a quarter turn about x.
    const double half = std::sqrt(0.5);
    Json json = {{"asset", {{"version", "2.0"}, {"generator", "swiftlet"}}},
                 {"scene", 0},
                 {"scenes", {{{"nodes", {0}}}}},
                 {"nodes", {{{"mesh", 0}, {"name", "map"}, {"rotation", {-half, 0.0, 0.0, half}}}}},
                 {"meshes", {{{"name", "surface"}, {"primitives", {primitive}}}}},
                 {"materials",
                  {{{"name", "surface"},
                    {"doubleSided", true},
                    {"pbrMetallicRoughness", {{"metallicFactor", 0.0}, {"roughnessFactor", 1.0}}}}}},
                 {"accessors", accessors_},
                 {"bufferViews", views_},
                 {"buffers", {{{"byteLength", binary_.size()}}}}};
    writeGlb(path, json, binary_);
  }

 private:
  std::string binary_;
  Json views_ = Json::array();
  Json accessors_ = Json::array();
};

std::array<std::uint8_t, 4> shown(const MapMesh& mesh, std::size_t i) {
  const std::uint8_t grey = mesh.grey[i];
  if (mesh.labels[i] == 0) return {grey, grey, grey, 255};
  const std::array<std::uint8_t, 3> colour = labelColour(mesh.labels[i]);
  // Brightness between half and full, so that dark images do not hide the label.
  const auto part = [grey](std::uint8_t c) { return static_cast<std::uint8_t>(c * (255 + grey) / 510); };
  return {part(colour[0]), part(colour[1]), part(colour[2]), 255};
}

}  // namespace

std::array<std::uint8_t, 3> labelColour(std::uint8_t label) {
  // Hues differ by the golden angle, so that consecutive labels have different colours.
  const double hue = std::fmod(static_cast<double>(label) * 0.618033988749895, 1.0) * 6;
  const double lightness = label % 2 == 0 ? 0.75 : 1.0;
  std::array<std::uint8_t, 3> colour{};
  for (int i = 0; i < 3; ++i) {
    const double k = std::fmod(5.0 - 2 * i + hue, 6);
    const double value = lightness * (1 - 0.75 * std::clamp(std::min(k, 4 - k), 0.0, 1.0));
    colour[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(std::lround(255 * value));
  }
  return colour;
}

void writeMapPly(const std::string& path, const MapMesh& mesh) {
  PlyElement vertices{"vertex", mesh.vertices.size(), {{"x"}, {"y"}, {"z"}, {"nx"}, {"ny"}, {"nz"}}};
  for (const char* name : {"red", "green", "blue", "label", "label_probability"}) {
    vertices.properties.push_back({name, PlyType::kUint8});
  }
  constexpr std::size_t kVertexBytes = 6 * sizeof(float) + 5;
  std::string body;
  body.reserve(mesh.vertices.size() * kVertexBytes + mesh.faces.size() * kFaceBytes);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    append(body, mesh.vertices[i]);
    append(body, mesh.normals[i]);
    for (int k = 0; k < 3; ++k) appendBytes(body, mesh.grey[i]);
    appendBytes(body, mesh.labels[i]);
    appendBytes(body, mesh.probabilities[i]);
  }
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) appendFace(body, mesh.faces[i], mesh.faceLabel(i));
  writeAll(path, writePlyHeader({vertices, faceElement(mesh.faces.size())}, kMapComment), body);
}

void writeMapGlb(const std::string& path, const MapMesh& mesh) {
  if (mesh.faces.empty()) {
    // Accessors without elements are not allowed, so an empty map becomes an empty scene.
    writeGlb(path,
             {{"asset", {{"version", "2.0"}, {"generator", "swiftlet"}}},
              {"scene", 0},
              {"scenes", {{{"name", "empty"}}}}},
             "");
    return;
  }
  GlbBuilder glb;
  const std::size_t n = mesh.vertices.size();
  Eigen::Vector3f low = mesh.vertices.front();
  Eigen::Vector3f high = low;
  for (const Eigen::Vector3f& p : mesh.vertices) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  Json attributes;
  attributes["POSITION"] = glb.accessor(n, kFloat, "VEC3", false, kVertexBuffer, [&](std::string& out) {
    for (const Eigen::Vector3f& p : mesh.vertices) append(out, p);
  });
  glb.last()["min"] = {low.x(), low.y(), low.z()};
  glb.last()["max"] = {high.x(), high.y(), high.z()};
  attributes["NORMAL"] = glb.accessor(n, kFloat, "VEC3", false, kVertexBuffer, [&](std::string& out) {
    for (const Eigen::Vector3f& normal : mesh.normals) append(out, normal);
  });
  attributes["COLOR_0"] = glb.accessor(n, kUnsignedByte, "VEC4", true, kVertexBuffer, [&](std::string& out) {
    for (std::size_t i = 0; i < n; ++i) appendBytes(out, shown(mesh, i));
  });
  // Four bytes per vertex, as the format's alignment requires; the last two are unused.
  attributes["_LABEL"] = glb.accessor(n, kUnsignedByte, "VEC4", false, kVertexBuffer, [&](std::string& out) {
    for (std::size_t i = 0; i < n; ++i) {
      appendBytes(out, std::array<std::uint8_t, 4>{mesh.labels[i], mesh.probabilities[i], 0, 0});
    }
  });
  const int indices =
      glb.accessor(3 * mesh.faces.size(), kUnsignedInt, "SCALAR", false, kIndexBuffer, [&](std::string& out) {
        for (const auto& face : mesh.faces) appendBytes(out, face);
      });
  glb.write(path, {{"attributes", attributes}, {"indices", indices}, {"mode", kTriangles}, {"material", 0}});
}

}  // namespace swiftlet
