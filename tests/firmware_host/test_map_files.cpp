// The map's files: PLY read back, the glTF file taken apart by the specification's rules.

#include <catch2/catch.hpp>
#include <cstring>
#include <nlohmann/json.hpp>

#include "drivers/input/input_error.hpp"
#include "firmware_host/outputs/map_files/map_files.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

using test::textOf;

MapMesh tetrahedron() {
  MapMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, -3}};
  for (const Eigen::Vector3f& p : mesh.vertices)
    mesh.normals.push_back((p.array() + 1).matrix().normalized());
  mesh.grey = {10, 20, 30, 255};
  mesh.labels = {4, 4, 0, 7};
  mesh.probabilities = {255, 128, 0, 60};
  mesh.faces = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return mesh;
}

template <typename T>
T at(const std::string& bytes, std::size_t offset) {
  T value;
  REQUIRE(offset + sizeof(T) <= bytes.size());
  std::memcpy(&value, bytes.data() + offset, sizeof(T));
  return value;
}

struct Glb {
  nlohmann::json json;
  std::string binary;
};

Glb takeApart(const std::string& bytes) {
  Glb glb;
  REQUIRE(bytes.substr(0, 4) == "glTF");
  REQUIRE(at<std::uint32_t>(bytes, 4) == 2);
  REQUIRE(at<std::uint32_t>(bytes, 8) == bytes.size());
  const auto length = at<std::uint32_t>(bytes, 12);
  REQUIRE(length % 4 == 0);
  REQUIRE(bytes.substr(16, 4) == "JSON");
  glb.json = nlohmann::json::parse(bytes.substr(20, length));
  const std::size_t next = 20 + length;
  if (next == bytes.size()) return glb;
  const auto binary = at<std::uint32_t>(bytes, next);
  REQUIRE(binary % 4 == 0);
  REQUIRE(bytes.substr(next + 4, 4) == std::string("BIN\0", 4));
  REQUIRE(next + 8 + binary == bytes.size());
  glb.binary = bytes.substr(next + 8);
  return glb;
}

std::size_t bytesOf(const nlohmann::json& accessor) {
  const std::size_t component = accessor["componentType"] == 5121 ? 1 : 4;
  const std::size_t parts = accessor["type"] == "SCALAR" ? 1 : accessor["type"] == "VEC3" ? 3 : 4;
  return component * parts * accessor["count"].get<std::size_t>();
}

TEST_CASE("a map read back from PLY has its triangles, grey values and labels", "[map_files]") {
  const ScratchFolder folder("map_files");
  const std::string path = folder.file("map.ply");
  const MapMesh mesh = tetrahedron();
  writeMapPly(path, mesh);
  const TriangleMesh read = readPly(path);
  CHECK(read.vertices == mesh.vertices);
  CHECK(read.faces == mesh.faces);
  CHECK(read.grey == mesh.grey);
  CHECK(read.labels == std::vector<std::uint8_t>{4, 4, 4, 4});
}

TEST_CASE("a face takes the label of most corners, the unlabelled left out", "[map_files]") {
  MapMesh mesh = tetrahedron();
  mesh.labels = {0, 5, 5, 2};
  CHECK(mesh.faceLabel(0) == 5);
  CHECK(mesh.faceLabel(3) == 5);
  mesh.labels = {0, 0, 0, 2};
  CHECK(mesh.faceLabel(0) == 0);
  CHECK(mesh.faceLabel(1) == 2);
}

TEST_CASE("the glTF file keeps to the format, accessor by accessor", "[map_files]") {
  const ScratchFolder folder("map_files");
  const std::string path = folder.file("map.glb");
  const MapMesh mesh = tetrahedron();
  writeMapGlb(path, mesh);
  const Glb glb = takeApart(textOf(path));
  CHECK(glb.json["asset"]["version"] == "2.0");
  CHECK(glb.json["buffers"][0]["byteLength"] == glb.binary.size());
  for (const auto& accessor : glb.json["accessors"]) {
    const auto& view = glb.json["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    CHECK(view["byteOffset"].get<std::size_t>() % 4 == 0);
    CHECK(view["byteLength"].get<std::size_t>() == bytesOf(accessor));
    CHECK(view["byteOffset"].get<std::size_t>() + view["byteLength"].get<std::size_t>() <= glb.binary.size());
  }
  const auto& primitive = glb.json["meshes"][0]["primitives"][0];
  const auto accessorOf = [&](const nlohmann::json& index) {
    return glb.json["accessors"][index.get<std::size_t>()];
  };
  const auto viewOf = [&](const nlohmann::json& index) {
    return glb.json["bufferViews"][accessorOf(index)["bufferView"].get<std::size_t>()]["byteOffset"]
        .get<std::size_t>();
  };
  const auto position = accessorOf(primitive["attributes"]["POSITION"]);
  CHECK(position["min"] == nlohmann::json({0.0, 0.0, -3.0}));
  CHECK(position["max"] == nlohmann::json({1.0, 2.0, 0.0}));
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t offset = viewOf(primitive["attributes"]["POSITION"]) + 4 * (3 * i + axis);
      CHECK(at<float>(glb.binary, offset) == mesh.vertices[i][static_cast<int>(axis)]);
    }
    CHECK(at<std::uint8_t>(glb.binary, viewOf(primitive["attributes"]["_LABEL"]) + 4 * i) == mesh.labels[i]);
  }
  for (std::size_t i = 0; i < 3 * mesh.faces.size(); ++i) {
    CHECK(at<std::uint32_t>(glb.binary, viewOf(primitive["indices"]) + 4 * i) == mesh.faces[i / 3][i % 3]);
  }
}

TEST_CASE("an empty map is an empty scene and an empty mesh, not a broken file", "[map_files]") {
  const ScratchFolder folder("map_files");
  writeMapGlb(folder.file("map.glb"), {});
  CHECK(takeApart(textOf(folder.file("map.glb"))).json["scene"] == 0);
  writeMapPly(folder.file("map.ply"), {});
  CHECK(readPly(folder.file("map.ply")).vertices.empty());
}

TEST_CASE("a folder that is not there is named", "[map_files]") {
  const ScratchFolder folder("map_files");
  CHECK_THROWS_WITH(writeMapPly(folder.file("none/map.ply"), tetrahedron()), Catch::Contains("none/map.ply"));
  CHECK_THROWS_WITH(writeMapGlb(folder.file("none/map.glb"), tetrahedron()), Catch::Contains("none/map.glb"));
}

TEST_CASE("labels that follow each other differ in colour", "[map_files]") {
  for (std::uint8_t a = 1; a < 32; ++a) {
    const auto here = labelColour(a);
    const auto next = labelColour(static_cast<std::uint8_t>(a + 1));
    int difference = 0;
    for (std::size_t i = 0; i < 3; ++i) difference += std::abs(here[i] - next[i]);
    CHECK(difference > 60);
  }
}

}  // namespace
}  // namespace swiftlet
