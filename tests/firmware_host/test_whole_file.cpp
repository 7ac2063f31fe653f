// Files that are no streams are there as a whole or not at all: whatever fails in the middle leaves the older
// file as it was, and nothing beside it.

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/modules/g2o_file.hpp"
#include "firmware_host/outputs/map_files/kept_map.hpp"
#include "firmware_host/outputs/map_files/map_files.hpp"
#include "firmware_host/outputs/map_files/map_mesh.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "firmware_host/outputs/run_folder/loops_csv.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "tests/firmware_host/file_size_limit.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

using test::textOf;

constexpr rlim_t kLimit = 64;             // bytes; the smallest file, an empty map's, is larger
constexpr std::size_t kElements = 20000;  // of the others: more than any buffer holds

std::vector<std::string> names(const std::string& folder) {
  std::vector<std::string> found;
  for (const auto& entry : fs::directory_iterator(folder)) found.push_back(entry.path().filename());
  return found;
}

using Write = std::function<void(const std::string&)>;

TriangleMesh manyPoints() {
  TriangleMesh mesh;
  mesh.vertices.resize(kElements, Eigen::Vector3f::Zero());
  return mesh;
}

MapMesh manyFaces() {
  MapMesh mesh;
  mesh.vertices.resize(kElements, Eigen::Vector3f::Zero());
  mesh.normals.resize(kElements, Eigen::Vector3f::UnitZ());
  mesh.grey.resize(kElements);
  mesh.labels.resize(kElements);
  mesh.probabilities.resize(kElements);
  mesh.faces.push_back({0, 1, 2});
  return mesh;
}

G2oGraph manyPoses() {
  G2oGraph graph;
  graph.planar = false;
  graph.has_poses = true;
  graph.space.poses.resize(kElements);
  for (std::size_t i = 0; i < kElements; ++i) graph.ids.push_back(static_cast<std::int64_t>(i));
  return graph;
}

std::unique_ptr<MapStage> emptyMap() {
  Rig rig;
  rig.camera_count = 1;
  rig.camera[0] = CameraModel(CameraKind::kPinholeRadtan, 160, 120, {100, 100, 80, 60}, {0, 0, 0, 0});
  DepthImageView sensor;
  sensor.camera = {100, 100, 80, 60, 160, 120};
  MapSettings settings;
  settings.volume_mib = 8;
  settings.surface_mib = 4;
  return std::make_unique<MapStage>(rig, settings, &sensor);
}

const std::vector<std::pair<const char*, Write>>& writers() {
  static const std::vector<std::pair<const char*, Write>> kWriters = {
      {"text", [](const std::string& path) { writeWholeFile(path, std::string(kElements, 'x')); }},
      {"text without sync",
       [](const std::string& path) {
         writeWholeFile(path, std::string(kElements, 'x'), WholeFile::Sync::kNo);
       }},
      {"summary.json", [](const std::string& path) { writeJson(path, std::vector<int>(kElements)); }},
      {"loops.csv", [](const std::string& path) { writeLoops(path, std::vector<MapLoop>(kElements)); }},
      {"local_mesh.ply", [](const std::string& path) { writePly(path, manyPoints()); }},
      {"map.ply", [](const std::string& path) { writeMapPly(path, manyFaces()); }},
      {"map.glb", [](const std::string& path) { writeMapGlb(path, manyFaces()); }},
      {"graph.g2o", [](const std::string& path) { writeG2oFile(path, manyPoses()); }},
      {"kept map",
       [](const std::string& path) {
         (void)writeKeptMapFile(path, *emptyMap(), [](std::uint32_t) { return true; });
       }},
  };
  return kWriters;
}

}  // namespace

TEST_CASE("a writer that fails in the middle leaves the older file and nothing beside it", "[files]") {
  for (const auto& [name, write] : writers()) {
    INFO(name);
    const ScratchFolder folder("whole_file");
    const std::string path = folder.file("file");
    std::ofstream(path) << "the older file";
    std::string message;
    {
      const FileSizeLimit limit(kLimit);
      try {
        write(path);
      } catch (const InputError& error) {
        message = error.what();
      }
    }
    CHECK_THAT(message, Catch::Contains(path) && Catch::Contains("File too large"));
    CHECK(textOf(path) == "the older file");
    CHECK(names(folder.path()) == std::vector<std::string>{"file"});
    write(path);
    CHECK(fs::file_size(path) > kLimit);
    CHECK(names(folder.path()) == std::vector<std::string>{"file"});
  }
}

TEST_CASE("a file that is given up leaves the older one", "[files]") {
  const ScratchFolder folder("whole_file");
  const std::string path = folder.file("file");
  std::ofstream(path) << "the older file";
  {
    WholeFile file(path);
    file.write("half of the new one");
  }
  CHECK(textOf(path) == "the older file");
  CHECK(names(folder.path()) == std::vector<std::string>{"file"});
}

TEST_CASE("until the new file has its name the older one can be read", "[files]") {
  const ScratchFolder folder("whole_file");
  const std::string path = folder.file("file");
  std::ofstream(path) << "the older file";
  WholeFile file(path);
  file.write("the new one");
  CHECK(textOf(path) == "the older file");
  file.commit();
  CHECK(textOf(path) == "the new one");
}

TEST_CASE("a link stays and what it leads to is replaced; devices are written as they are", "[files]") {
  const ScratchFolder folder("whole_file");
  std::ofstream(folder.file("file")) << "the older file";
  fs::create_symlink("file", folder.file("link"));
  writeWholeFile(folder.file("link"), "the new one");
  CHECK(fs::is_symlink(folder.file("link")));
  CHECK(textOf(folder.file("file")) == "the new one");

  fs::create_symlink("/dev/full", folder.file("full"));
  CHECK_THROWS_WITH(writeWholeFile(folder.file("full"), "no room"),
                    Catch::Contains("No space left on device"));
  CHECK(fs::is_symlink(folder.file("full")));
  fs::create_symlink("/dev/null", folder.file("null"));
  writeWholeFile(folder.file("null"), "gone");
  CHECK(fs::is_character_file("/dev/null"));
}

TEST_CASE("what cannot be written is named with the system's reason", "[files]") {
  const ScratchFolder folder("whole_file");
  std::ofstream(folder.file("file")) << "no folder";
  CHECK_THROWS_WITH(writeWholeFile(folder.file("file/below"), "x"),
                    Catch::Contains("file/below") && Catch::Contains("Not a directory"));
  CHECK_THROWS_WITH(writeWholeFile(folder.file("no/such"), "x"),
                    Catch::Contains("No such file or directory"));
  fs::create_directory(folder.file("sub"));
  CHECK_THROWS_WITH(writeWholeFile(folder.file("sub"), "x"), Catch::Contains("Is a directory"));
  CHECK(fs::is_directory(folder.file("sub")));
}

TEST_CASE("a part that a library wrote gets its name, or goes", "[files]") {
  const ScratchFolder folder("whole_file");
  std::ofstream(folder.file("bag.part")) << "new";
  std::ofstream(folder.file("bag")) << "old";
  commitPart(folder.file("bag.part"), folder.file("bag"));
  CHECK(textOf(folder.file("bag")) == "new");
  CHECK(names(folder.path()) == std::vector<std::string>{"bag"});
  fs::create_directories(folder.file("in_the_way/full"));
  std::ofstream(folder.file("other.part")) << "new";
  CHECK_THROWS_WITH(commitPart(folder.file("other.part"), folder.file("in_the_way")),
                    Catch::Contains("in_the_way"));
  CHECK_FALSE(fs::exists(folder.file("other.part")));
}

}  // namespace swiftlet
