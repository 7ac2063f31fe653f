// PLY files: what is written is read again, other programs' forms are taken, damage is named.

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>

#include "drivers/input/input_error.hpp"
#include "estimator/core/random.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/input_error.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

using test::contains;
using test::messageOf;
using test::textOf;

TriangleMesh randomMesh(std::uint32_t vertices, std::uint32_t faces) {
  Random random(vertices, faces);
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i < vertices; ++i) {
    mesh.vertices.push_back(Eigen::Vector3d(random.normal(), random.normal(), random.normal()).cast<float>());
    mesh.grey.push_back(static_cast<std::uint8_t>(random.below(256)));
  }
  for (std::uint32_t i = 0; i < faces; ++i) {
    mesh.faces.push_back({random.below(vertices), random.below(vertices), random.below(vertices)});
    mesh.labels.push_back(static_cast<std::uint8_t>(random.below(256)));
  }
  return mesh;
}

const std::string kHeader =
    "ply\nformat ascii 1.0\ncomment a triangle\nelement vertex 3\nproperty float x\nproperty float y\n"
    "property float z\nelement face 1\nproperty list uchar int vertex_indices\nproperty uchar label\n"
    "end_header\n";
const std::string kBody = "0 0 0\n1 0 0\n0 1.5 0\n3 0 1 2 7\n";

/// The message that reading ends with; empty when it succeeds.
std::string complaint(const std::string& bytes) {
  return messageOf([&] { (void)readPlyText("m.ply", bytes); });
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

TEST_CASE("PLY: what is written is read again, to the bit") {
  const ScratchFolder folder("ply");
  const std::string path = folder.file("mesh.ply");
  const TriangleMesh mesh = randomMesh(200, 300);
  writePly(path, mesh);
  const TriangleMesh read = readPly(path);
  CHECK(read.vertices == mesh.vertices);
  CHECK(read.grey == mesh.grey);
  CHECK(read.faces == mesh.faces);
  CHECK(read.labels == mesh.labels);

  TriangleMesh bare = mesh;
  bare.grey.clear();
  bare.labels.clear();
  writePly(path, bare);
  CHECK(readPly(path).grey == std::vector<std::uint8_t>(200, 128));
  CHECK(readPly(path).labels == std::vector<std::uint8_t>(300, 0));
  writePly(path, {});
  CHECK(readPly(path).vertices.empty());
}

TEST_CASE("PLY: ASCII, as the truth of a log has it") {
  const TriangleMesh mesh = readPlyText("m.ply", kHeader + kBody);
  REQUIRE(mesh.vertices.size() == 3);
  CHECK(mesh.vertices[2] == Eigen::Vector3f(0, 1.5f, 0));
  REQUIRE(mesh.faces.size() == 1);
  CHECK(mesh.faces[0] == std::array<std::uint32_t, 3>{0, 1, 2});
  CHECK(mesh.labels == std::vector<std::uint8_t>{7});
  CHECK(mesh.grey.empty());
  // No line end at the end, blank lines, CRLF.
  CHECK(readPlyText("m", kHeader + kBody.substr(0, kBody.size() - 1)).faces == mesh.faces);
  CHECK(readPlyText("m", kHeader + "\n" + kBody + " \n\n").faces == mesh.faces);
  std::string crlf;
  for (const char c : kHeader + kBody) crlf += c == '\n' ? std::string("\r\n") : std::string(1, c);
  CHECK(readPlyText("m", crlf).vertices == mesh.vertices);
}

TEST_CASE("PLY: other properties and elements are passed over, colours become grey") {
  const std::string text =
      "ply\nformat ascii 1.0\nelement camera 1\nproperty list uchar float numbers\nelement face 1\n"
      "property list uint8 uint vertex_index\nelement vertex 3\nproperty double x\nproperty double y\n"
      "property double z\nproperty float confidence\nproperty uchar red\nproperty uchar green\n"
      "property uchar blue\nend_header\n2 0.5 nan\n3 2 1 0\n1 2 3 nan 255 0 0\n4 5 6 0 0 255 0\n7 8 9 0 10 "
      "10 10\n";
  const TriangleMesh mesh = readPlyText("m.ply", text);
  CHECK(mesh.vertices[1] == Eigen::Vector3f(4, 5, 6));
  CHECK(mesh.grey == std::vector<std::uint8_t>{76, 150, 10});
  CHECK(mesh.faces[0] == std::array<std::uint32_t, 3>{2, 1, 0});
  CHECK(mesh.labels == std::vector<std::uint8_t>{0});
}

TEST_CASE("PLY: damage is named with line, field and remedy") {
  const std::string whole = kHeader + kBody;
  REQUIRE(complaint(whole).empty());
  CHECK(complaint("") == "m.ply:1: the header has no end. Check that it is a complete PLY file");
  CHECK(contains(complaint("solid\n"), "does not begin with `ply`"));
  CHECK(contains(complaint(replaced(whole, "ascii", "binary_big_endian")), "m.ply:2: format: `binary_big"));
  CHECK(contains(complaint(replaced(whole, "float y", "half y")), "m.ply:6: property: `half`"));
  CHECK(contains(complaint(replaced(whole, "float y", "float x")), "appears twice"));
  CHECK(contains(complaint(replaced(whole, "float z", "float w")), "vertex z: no such property"));
  CHECK(contains(complaint(replaced(whole, "vertex_indices", "corners")), "vertex_indices: no such list"));
  CHECK(contains(complaint(replaced(whole, "vertex 3", "vertex -3")), "m.ply:4: element"));
  CHECK(contains(complaint(replaced(whole, "1 0 0", "1 nan 0")),
                 "m.ply:13: `vertex` 1 `y`: is not finite. Remove"));
  CHECK(contains(complaint(replaced(whole, "1 0 0", "1 1e39 0")), "is not finite"));
  CHECK(contains(complaint(replaced(whole, "1 0 0", "1 oops 0")), "`oops` is not a number"));
  CHECK(contains(complaint(replaced(whole, "1 0 0", "1 0")), "m.ply:13: `vertex` 1 `z`: missing"));
  CHECK(contains(complaint(replaced(whole, "1 0 0", "1 0 0 0")), "more than the header declares"));
  CHECK(contains(complaint(replaced(whole, "0 1 2 7", "0 1 3 7")), "m.ply:15: `face` 0 `vertex_indices`"));
  CHECK(contains(complaint(replaced(whole, "0 1 2 7", "0 1 -1 7")), "not among the 3"));
  CHECK(contains(complaint(replaced(whole, "3 0 1 2 7", "4 0 1 2 1 7")), "4 corners instead of 3"));
  CHECK(contains(complaint(replaced(whole, "0 1 2 7", "0 1 2 256")), "does not fit its type"));
  CHECK(contains(complaint(whole + "1 2 3\n"), "after the last element"));
}

TEST_CASE("PLY: a file cut anywhere is refused, and a header's count alone reserves nothing") {
  const ScratchFolder folder("ply_cut");
  const std::string path = folder.file("mesh.ply");
  writePly(path, randomMesh(5, 4));
  const std::string binary = textOf(path);
  REQUIRE(complaint(binary).empty());
  for (std::size_t size = 0; size < binary.size(); ++size)
    CHECK_FALSE(complaint(binary.substr(0, size)).empty());
  CHECK(contains(complaint(binary + "x"), "1 bytes after the last element"));
  const std::string ascii = kHeader + kBody;
  // The last cut takes the line end alone, the one before it the label.
  for (std::size_t size = 0; size + 1 < ascii.size(); ++size) {
    CHECK_FALSE(complaint(ascii.substr(0, size)).empty());
  }
  for (const char* count : {"2000000000", "9223372036854775807", "9223372036854775808", "5e9"}) {
    CHECK_FALSE(complaint(replaced(binary, "vertex 5", std::string("vertex ") + count)).empty());
    CHECK_FALSE(complaint(replaced(binary, "face 4", std::string("face ") + count)).empty());
    CHECK_FALSE(complaint(replaced(ascii, "vertex 3", std::string("vertex ") + count)).empty());
  }
  CHECK(contains(complaint(replaced(binary, "vertex 5", "vertex 2000000000")), "need more than the"));

  std::string broken = binary;
  const float nan = std::nanf("");
  const std::size_t body = binary.find("end_header\n") + 11;
  std::memcpy(broken.data() + body + 15 + 8, &nan, sizeof nan);
  CHECK(contains(complaint(broken), "m.ply: `vertex` 1 `z` at byte " + std::to_string(body + 23)));
}

TEST_CASE("PLY: what could not be read again is not written") {
  const ScratchFolder folder("ply_write");
  const std::string path = folder.file("mesh.ply");
  TriangleMesh mesh = randomMesh(4, 2);
  CHECK_THROWS_AS(writePly(folder.file("no/such/folder.ply"), mesh), InputError);
  mesh.faces[1][2] = 4;
  CHECK_THROWS_AS(writePly(path, mesh), InputError);
  mesh = randomMesh(4, 2);
  mesh.vertices[3].y() = std::numeric_limits<float>::infinity();
  CHECK_THROWS_AS(writePly(path, mesh), InputError);
  mesh = randomMesh(4, 2);
  mesh.labels.pop_back();
  CHECK_THROWS_AS(writePly(path, mesh), InputError);
  CHECK_FALSE(std::filesystem::exists(path));
  CHECK_THROWS_AS(readPly(path), InputError);
}

}  // namespace
}  // namespace swiftlet
