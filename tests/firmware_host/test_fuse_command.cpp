// `swiftlet fuse`: the map alone with given poses, from the command line to its files.

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "firmware_host/commands/program.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "tests/firmware_host/run_program.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

const std::string kLog = std::string(SWIFTLET_TEST_DATA) + "/euroc_mh01_4s";

using test::run;

TEST_CASE("a second of a real flight gives a map from stereo, in files that others read", "[fuse_command]") {
  const ScratchFolder folder("fuse");
  const std::string out = folder.file("map");
  REQUIRE(run({"fuse", kLog, "--out", out, "--until", "1", "--interval", "0.25"}) == kExitDone);
  const TriangleMesh mesh = readPly(out + "/map.ply");
  CHECK(mesh.faces.size() > 2000);
  CHECK(fs::file_size(out + "/map.glb") > 100'000);
  std::ifstream file(out + "/summary.json");
  const nlohmann::json summary = nlohmann::json::parse(file);
  CHECK(summary["run"]["depth"] == "stereo");
  CHECK(summary["moments"]["fused"].get<int>() >= 4);
  CHECK(summary["moments"]["refused"] == 0);
  CHECK(summary["map"]["mesh"]["faces"] == mesh.faces.size());
}

TEST_CASE("a kept map is continued, a damaged one refused before anything is written", "[fuse_command]") {
  const ScratchFolder folder("fuse_kept");
  const std::string kept = folder.file("kept.swm"), both = folder.file("both"), out = folder.file("out");
  REQUIRE(run({"fuse", kLog, "--out", folder.file("first"), "--until", "0.6", "--keep", kept}) == kExitDone);
  REQUIRE(run({"fuse", kLog, "--out", both, "--from", "0.6", "--until", "1", "--continue", kept}) ==
          kExitDone);
  std::ifstream file(both + "/summary.json");
  const nlohmann::json summary = nlohmann::json::parse(file);
  CHECK(summary["continued"]["held"]["blocks"].get<int>() > 100);
  const std::size_t first = readPly(folder.file("first") + "/map.ply").faces.size();
  CHECK(readPly(both + "/map.ply").faces.size() > first);
  CHECK_FALSE(fs::exists(kept + ".part"));

  CHECK(run({"fuse", kLog, "--out", out, "--continue", kept, "--set", "map.voxel_size=0.1"}) ==
        kExitBadInput);
  fs::resize_file(kept, fs::file_size(kept) - 1);
  CHECK(run({"fuse", kLog, "--out", out, "--continue", kept}) == kExitBadInput);
  CHECK(run({"fuse", kLog, "--out", out, "--keep", folder.file("nowhere/kept.swm")}) == kExitBadInput);
  CHECK_FALSE(fs::exists(out));
}

TEST_CASE("what cannot be fused is refused with a remedy", "[fuse_command]") {
  const ScratchFolder folder("fuse_bad");
  const std::string out = folder.file("map");
  CHECK(run({"fuse", kLog, "--out", out, "--depth", "sensor"}) == kExitBadInput);
  CHECK(run({"fuse", kLog, "--out", out, "--depth", "sonar"}) == kExitBadInput);
  CHECK(run({"fuse", kLog, "--out", out, "--set", "map.moving_labels=chair"}) == kExitBadInput);
  CHECK(run({"fuse", kLog, "--out", out, "--set", "map.voxel_size=0.02", "--set", "map.most_range=90"}) ==
        kExitBadInput);
  CHECK(run({"fuse", folder.file("nowhere"), "--out", out}) == kExitBadInput);
  CHECK_FALSE(fs::exists(out));
}

}  // namespace
}  // namespace swiftlet
