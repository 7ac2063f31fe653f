#include "firmware_host/outputs/map_files/ply_file.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "drivers/input/input_error.hpp"
#include "drivers/input/read_file.hpp"
#include "firmware_host/outputs/map_files/ply_header.hpp"
#include "firmware_host/outputs/map_files/ply_values.hpp"
#include "firmware_host/outputs/map_files/ply_writer.hpp"

namespace swiftlet {
namespace {

constexpr std::uint8_t kGreyOfNone = 128;
constexpr std::size_t kCorners = 3;
constexpr double kMaxByte = 255;
// Luma of BT.601.
constexpr double kRedWeight = 0.299;
constexpr double kGreenWeight = 0.587;
constexpr double kBlueWeight = 0.114;

const PlyElement* elementNamed(const PlyHeader& header, std::string_view name) {
  const auto found = std::ranges::find(header.elements, name, &PlyElement::name);
  return found == header.elements.end() ? nullptr : &*found;
}

class MeshReader {
 public:
  MeshReader(const std::string& name, std::string_view bytes)
      : name_(name), header_(readPlyHeader(name, bytes)), values_(name, bytes, header_) {}

  TriangleMesh operator()() {
    checkProperties();
    for (const PlyElement& element : header_.elements) {
      for (std::uint64_t i = 0; i < element.count; ++i) {
        values_.beginRow(element, i);
        if (element.name == "vertex") {
          readVertex(element);
        } else if (element.name == "face") {
          readFace(element);
        } else {
          for (const PlyProperty& property : element.properties) passOver(property);
        }
        values_.endRow();
      }
    }
    values_.finish();
    return std::move(mesh_);
  }

 private:
  static bool isIndices(const PlyProperty& property) {
    return property.is_list && (property.name == "vertex_indices" || property.name == "vertex_index");
  }

  static bool hasScalar(const PlyElement& element, std::string_view name) {
    const auto found = std::ranges::find(element.properties, name, &PlyProperty::name);
    return found != element.properties.end() && !found->is_list;
  }

  void checkProperties() {
    const PlyElement* vertex = elementNamed(header_, "vertex");
    if (vertex == nullptr) throw InputError(name_, 0, "", "has no element `vertex`", "Give a mesh or points");
    for (const char* axis : {"x", "y", "z"}) {
      if (hasScalar(*vertex, axis)) continue;
      throw InputError(name_, 0, std::string("vertex ") + axis, "no such property", "Give a mesh or points");
    }
    has_colour_ = hasScalar(*vertex, "red") && hasScalar(*vertex, "green") && hasScalar(*vertex, "blue");
    vertex_count_ = vertex->count;
    const PlyElement* face = elementNamed(header_, "face");
    if (face != nullptr && face->count > 0 && std::ranges::count_if(face->properties, isIndices) != 1) {
      throw InputError(name_, 0, "face vertex_indices", "no such list", "Give a mesh of triangles");
    }
    // The header's counts have been checked against the file's size.
    mesh_.vertices.reserve(vertex->count);
    mesh_.grey.reserve(has_colour_ ? vertex->count : 0);
    mesh_.faces.reserve(face == nullptr ? 0 : face->count);
    mesh_.labels.reserve(face == nullptr ? 0 : face->count);
  }

  void passOver(const PlyProperty& property) {
    const std::uint64_t length =
        property.is_list ? values_.nextLength(property.count_type, property.name) : 1;
    for (std::uint64_t k = 0; k < length; ++k) (void)values_.next(property.type, property.name);
  }

  float coordinate(const PlyProperty& property) {
    const double value = values_.next(property.type, property.name);
    if (!(std::abs(value) <= std::numeric_limits<float>::max())) {
      throw values_.error(property.name, "is not finite", "Remove the vertex and its faces");
    }
    return static_cast<float>(value);
  }

  double byteValue(const PlyProperty& property) {
    const double value = values_.next(property.type, property.name);
    if (!(value >= 0 && value <= kMaxByte && value == std::floor(value))) {
      throw values_.error(property.name, "is not a whole number from 0 to 255", "Write it as uchar");
    }
    return value;
  }

  void readVertex(const PlyElement& element) {
    Eigen::Vector3f p = Eigen::Vector3f::Zero();
    double grey = 0;
    for (const PlyProperty& property : element.properties) {
      const std::string_view name = property.is_list ? std::string_view() : std::string_view(property.name);
      if (name == "x") {
        p.x() = coordinate(property);
      } else if (name == "y") {
        p.y() = coordinate(property);
      } else if (name == "z") {
        p.z() = coordinate(property);
      } else if (has_colour_ && name == "red") {
        grey += kRedWeight * byteValue(property);
      } else if (has_colour_ && name == "green") {
        grey += kGreenWeight * byteValue(property);
      } else if (has_colour_ && name == "blue") {
        grey += kBlueWeight * byteValue(property);
      } else {
        passOver(property);
      }
    }
    mesh_.vertices.push_back(p);
    if (has_colour_) mesh_.grey.push_back(static_cast<std::uint8_t>(std::lround(grey)));
  }

  std::array<std::uint32_t, 3> corners(const PlyProperty& property) {
    const std::uint64_t length = values_.nextLength(property.count_type, property.name);
    if (length != kCorners) {
      throw values_.error(property.name, std::to_string(length) + " corners instead of 3",
                          "Save the mesh as triangles");
    }
    std::array<std::uint32_t, 3> face{};
    for (std::uint32_t& corner : face) {
      const double index = values_.next(property.type, property.name);
      if (!(index >= 0 && index < static_cast<double>(vertex_count_) && index == std::floor(index))) {
        throw values_.error(property.name,
                            "refers to a vertex that is not among the " + std::to_string(vertex_count_),
                            "Indices start at 0; write the file again");
      }
      corner = static_cast<std::uint32_t>(index);
    }
    return face;
  }

  void readFace(const PlyElement& element) {
    std::uint8_t label = 0;
    for (const PlyProperty& property : element.properties) {
      if (isIndices(property)) {
        mesh_.faces.push_back(corners(property));
      } else if (!property.is_list && property.name == "label") {
        label = static_cast<std::uint8_t>(byteValue(property));
      } else {
        passOver(property);
      }
    }
    mesh_.labels.push_back(label);
  }

  const std::string& name_;
  PlyHeader header_;
  PlyValues values_;
  bool has_colour_ = false;
  std::uint64_t vertex_count_ = 0;
  TriangleMesh mesh_;
};

void checkWritable(const std::string& path, const TriangleMesh& mesh) {
  const auto refuse = [&](const std::string& field, const std::string& message) {
    throw InputError(path, 0, field, message,
                     "The mesh passed to the writer is invalid; nothing was written");
  };
  const std::size_t vertices = mesh.vertices.size();
  if (!mesh.grey.empty() && mesh.grey.size() != vertices)
    refuse("grey", "does not have one value per vertex");
  if (!mesh.labels.empty() && mesh.labels.size() != mesh.faces.size()) {
    refuse("label", "does not have one value per face");
  }
  for (std::size_t i = 0; i < vertices; ++i) {
    if (!mesh.vertices[i].allFinite()) refuse("vertex " + std::to_string(i), "is not finite");
  }
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    if (std::ranges::any_of(mesh.faces[i], [&](std::uint32_t v) { return v >= vertices; })) {
      refuse("face " + std::to_string(i), "refers to a vertex that does not exist");
    }
  }
}

std::string plyBytes(const TriangleMesh& mesh) {
  constexpr std::size_t kVertexBytes = 15;
  PlyElement vertices{"vertex", mesh.vertices.size(), {{"x"}, {"y"}, {"z"}}};
  for (const char* colour : {"red", "green", "blue"})
    vertices.properties.push_back({colour, PlyType::kUint8});
  std::string bytes = writePlyHeader({vertices, faceElement(mesh.faces.size())}, "");
  bytes.reserve(bytes.size() + kVertexBytes * mesh.vertices.size() + kFaceBytes * mesh.faces.size());
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    for (const float x : mesh.vertices[i]) appendBytes(bytes, x);
    bytes.append(3, static_cast<char>(mesh.grey.empty() ? kGreyOfNone : mesh.grey[i]));
  }
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    appendFace(bytes, mesh.faces[i], mesh.labels.empty() ? std::uint8_t{0} : mesh.labels[i]);
  }
  return bytes;
}

}  // namespace

void writePly(const std::string& path, const TriangleMesh& mesh, WholeFile::Sync sync) {
  checkWritable(path, mesh);
  writeWholeFile(path, plyBytes(mesh), sync);
}

TriangleMesh readPlyText(const std::string& name, std::string_view bytes) {
  return MeshReader(name, bytes)();
}

TriangleMesh readPly(const std::string& path) { return readPlyText(path, readFile(path, "Give a PLY file")); }

}  // namespace swiftlet
