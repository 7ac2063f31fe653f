#include "firmware_host/outputs/map_files/map_files.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>

#include "drivers/input/input_error.hpp"
#include "firmware_host/files/whole_file.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little, "both formats are written as the memory has them");

class Bytes {
 public:
  template <typename T>
  void add(const T& value) {
    const auto at = bytes_.size();
    bytes_.resize(at + sizeof(T));
    std::memcpy(bytes_.data() + at, &value, sizeof(T));
  }
  void add(const Eigen::Vector3f& p) {
    for (int i = 0; i < 3; ++i) add(p[i]);
  }
  void pad(std::size_t to, char with) { bytes_.resize((bytes_.size() + to - 1) / to * to, with); }
  void reserve(std::size_t count) { bytes_.reserve(count); }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] const std::vector<char>& get() const { return bytes_; }

 private:
  std::vector<char> bytes_;
};

void writeAll(const std::string& path, const std::vector<char>& head, const std::vector<char>& body) {
  WholeFile file(path);
  file.write({head.data(), head.size()});
  file.write({body.data(), body.size()});
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
    binary_.pad(kChunkAlignment, 0);
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
    std::string text = json.dump();
    text.resize((text.size() + kChunkAlignment - 1) / kChunkAlignment * kChunkAlignment, ' ');
    constexpr std::size_t kHeaders = 12 + 8 + 8;
    const std::size_t total = kHeaders + text.size() + binary_.size();
    if (total > std::numeric_limits<std::uint32_t>::max()) {
      throw InputError(path, 0, "", "the map exceeds the 4 GiB of a .glb file", "Use map.ply");
    }
    Bytes head;
    for (const std::uint32_t word : {kGlbMagic, kGlbVersion, static_cast<std::uint32_t>(total),
                                     static_cast<std::uint32_t>(text.size()), kJsonChunk}) {
      head.add(word);
    }
    for (const char c : text) head.add(c);
    head.add(static_cast<std::uint32_t>(binary_.size()));
    head.add(kBinaryChunk);
    writeAll(path, head.get(), binary_.get());
  }

 private:
  Bytes binary_;
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
  std::string head = "ply\nformat binary_little_endian 1.0\ncomment swiftlet: map axes, z up, metres\n";
  head += "element vertex " + std::to_string(mesh.vertices.size()) + "\n";
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"})
    head += std::string("property float ") + name + "\n";
  for (const char* name : {"red", "green", "blue", "label", "label_probability"}) {
    head += std::string("property uchar ") + name + "\n";
  }
  head += "element face " + std::to_string(mesh.faces.size()) +
          "\nproperty list uchar int vertex_indices\nproperty uchar label\nend_header\n";
  constexpr std::size_t kVertexBytes = 6 * sizeof(float) + 5;
  constexpr std::size_t kFaceBytes = 1 + 3 * sizeof(std::int32_t) + 1;
  Bytes body;
  body.reserve(mesh.vertices.size() * kVertexBytes + mesh.faces.size() * kFaceBytes);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    body.add(mesh.vertices[i]);
    body.add(mesh.normals[i]);
    for (int k = 0; k < 3; ++k) body.add(mesh.grey[i]);
    body.add(mesh.labels[i]);
    body.add(mesh.probabilities[i]);
  }
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    body.add(std::uint8_t{3});
    for (const std::uint32_t corner : mesh.faces[i]) body.add(static_cast<std::int32_t>(corner));
    body.add(mesh.faceLabel(i));
  }
  writeAll(path, {head.begin(), head.end()}, body.get());
}

void writeMapGlb(const std::string& path, const MapMesh& mesh) {
  if (mesh.faces.empty()) {
    // Accessors without elements are not allowed, so an empty map becomes an empty scene.
    Json json = {{"asset", {{"version", "2.0"}, {"generator", "swiftlet"}}},
                 {"scene", 0},
                 {"scenes", {{{"name", "empty"}}}}};
    std::string text = json.dump();
    text.resize((text.size() + kChunkAlignment - 1) / kChunkAlignment * kChunkAlignment, ' ');
    Bytes head;
    for (const std::uint32_t word : {kGlbMagic, kGlbVersion, static_cast<std::uint32_t>(20 + text.size()),
                                     static_cast<std::uint32_t>(text.size()), kJsonChunk}) {
      head.add(word);
    }
    writeAll(path, head.get(), {text.begin(), text.end()});
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
  attributes["POSITION"] = glb.accessor(n, kFloat, "VEC3", false, kVertexBuffer, [&](Bytes& out) {
    for (const Eigen::Vector3f& p : mesh.vertices) out.add(p);
  });
  glb.last()["min"] = {low.x(), low.y(), low.z()};
  glb.last()["max"] = {high.x(), high.y(), high.z()};
  attributes["NORMAL"] = glb.accessor(n, kFloat, "VEC3", false, kVertexBuffer, [&](Bytes& out) {
    for (const Eigen::Vector3f& normal : mesh.normals) out.add(normal);
  });
  attributes["COLOR_0"] = glb.accessor(n, kUnsignedByte, "VEC4", true, kVertexBuffer, [&](Bytes& out) {
    for (std::size_t i = 0; i < n; ++i) out.add(shown(mesh, i));
  });
  // Four bytes per vertex, as the format's alignment requires; the last two are unused.
  attributes["_LABEL"] = glb.accessor(n, kUnsignedByte, "VEC4", false, kVertexBuffer, [&](Bytes& out) {
    for (std::size_t i = 0; i < n; ++i) {
      out.add(std::array<std::uint8_t, 4>{mesh.labels[i], mesh.probabilities[i], 0, 0});
    }
  });
  const int indices =
      glb.accessor(3 * mesh.faces.size(), kUnsignedInt, "SCALAR", false, kIndexBuffer, [&](Bytes& out) {
        for (const auto& face : mesh.faces) out.add(face);
      });
  glb.write(path, {{"attributes", attributes}, {"indices", indices}, {"mode", kTriangles}, {"material", 0}});
}

}  // namespace swiftlet
