// Whole runs that keep a map, fly in it and go on with it, on the seconds of log in the repository.

#include <fmt/format.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <thread>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/trajectory_file.hpp"
#include "firmware_host/lab/evaluation/association.hpp"
#include "firmware_host/lab/modules/map_merge_run.hpp"
#include "firmware_host/outputs/map_files/kept_folder.hpp"
#include "firmware_host/outputs/map_files/kept_map.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/sanitized.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

using test::textOf;

Settings quick() {
  Settings settings;
  settings.mesh.enabled = false;
  settings.full_smoothing = false;
  return settings;
}

ReplayResult fly(const std::string& out, const KeptMapRequest& maps, const Settings& settings = quick()) {
  ReplayRequest request;
  request.log = shortLog();
  request.out = out;
  request.kept_maps = maps;
  return runReplay(request, settings);
}

Trajectory read(const std::string& path) { return readWholeTrajectory(path, "Run again"); }

TEST_CASE("a run is located in the map of another, which stays as it is") {
  const ScratchFolder folder("known_map");
  const std::string map = folder.file("map");
  fly(folder.file("first"), {map, "", false});
  CHECK(std::filesystem::exists(map + "/graph.swg"));
  CHECK_FALSE(std::filesystem::exists(map + ".part"));
  const std::string kept = textOf(map + "/graph.swg");

  const ReplayResult second = fly(folder.file("second"), {"", map, false});
  const auto& in_map = second.summary.at("counters").at("in_map");
  CHECK(in_map.at("nodes").get<std::size_t>() == readKeptFolder(map).nodes.size());
  CHECK(in_map.at("located_at_end").get<bool>());
  CHECK(in_map.at("taken_back").get<int>() == 0);
  CHECK(textOf(map + "/graph.swg") == kept);
  // The same images: the map's frame is the first run's world.
  const Trajectory lines = read(folder.file("second/in_map.tum"));
  REQUIRE(lines.size() > 5);
  AssociationOptions exact;
  for (const PosePair& pair : associate(lines, read(folder.file("first/odometry.tum")), exact).pairs) {
    CHECK((pair.estimate.translation - pair.truth.translation).norm() < 0.02);
  }
  // Nothing is written before the run is located.
  const double located = in_map.at("first_located_s").get<double>();
  const Stamp begin = *second.statistics.first_image;
  CHECK((lines.front().stamp - begin).seconds() == Approx(located).margin(1e-6));

  SECTION("an extended map, and one merged of two, hold both runs' nodes") {
    const std::string extended = folder.file("extended");
    fly(folder.file("third"), {extended, map, true});
    CHECK(textOf(map + "/graph.swg") == kept);
    CHECK(readKeptFolder(extended).nodes.size() > readKeptFolder(map).nodes.size());
    const auto merged = runMapMerge({map, extended, folder.file("merged")});
    CHECK(merged.at("loops_between").get<int>() >= 3);
    CHECK(mapInfo(folder.file("merged")).at("nodes") == merged.at("merged").at("nodes"));
  }
  SECTION("what is there already, missing or damaged is refused with its name, and nothing is written") {
    CHECK_THROWS_WITH(fly(folder.file("x"), {map, "", false}), Catch::Contains("already exists"));
    CHECK_THROWS_WITH(fly(folder.file("y"), {"", folder.file("none"), false}),
                      Catch::Contains("none/graph.swg"));
    CHECK_THROWS_WITH(fly(folder.file("w"), {folder.file("new"), map, false}), Catch::Contains("--extend"));
    std::string damaged = kept;
    damaged[damaged.size() / 2] ^= 1;
    std::filesystem::create_directories(folder.file("damaged"));
    std::ofstream(folder.file("damaged/graph.swg"), std::ios::binary) << damaged;
    CHECK_THROWS_WITH(fly(folder.file("z"), {"", folder.file("damaged"), false}),
                      Catch::Contains("checksum"));
    CHECK_THROWS_AS(runMapMerge({map, folder.file("damaged"), folder.file("m")}), InputError);
    CHECK_FALSE(std::filesystem::exists(folder.file("m")));
    CHECK_FALSE(std::filesystem::exists(folder.file("m.part")));
  }
}

/// Blocks with voxels that both hold bit by bit, of all that `part` holds.
double shareWithin(const VoxelVolume& part, const VoxelVolume& whole) {
  std::size_t blocks = 0, same = 0;
  for (std::uint32_t slot = 0; slot < part.slots(); ++slot) {
    if (part.voxels(slot) == nullptr) continue;
    ++blocks;
    const std::uint32_t other = whole.find(part.header(slot).index);
    if (other == VoxelVolume::kNone || whole.voxels(other) == nullptr) continue;
    const VoxelBlock &a = *part.voxels(slot), &b = *whole.voxels(other);
    same += a.distance == b.distance && a.weight == b.weight ? 1 : 0;
  }
  return static_cast<double>(same) / static_cast<double>(blocks);
}

TEST_CASE("the volume of a kept map is flown in, extended and merged") {
  const ScratchFolder folder("known_volume");
  const std::string map = folder.file("map");
  Settings settings = quick();
  settings.map.enabled = true;
  const ReplayResult first = fly(folder.file("first"), {map, "", false}, settings);
  const auto faces = [](const ReplayResult& run) {
    return run.summary.at("map").at("mesh").at("faces").get<int>();
  };
  const auto blocks = [](const std::string& kept) {
    return mapInfo(kept).at("volume").at("blocks").get<int>();
  };
  REQUIRE(blocks(map) > 100);

  SECTION("located, the map is that of both flights") {
    const std::string extended = folder.file("extended");
    const ReplayResult second = fly(folder.file("second"), {extended, map, true}, settings);
    REQUIRE(second.summary.at("counters").at("in_map").at("located_at_end").get<bool>());
    // What was seen twice has weight enough for more of the surface.
    CHECK(faces(second) > faces(first));
    // The images are the same: out of place they would need twice the blocks.
    CHECK(blocks(extended) >= blocks(map) * 95 / 100);
    CHECK(blocks(extended) < blocks(map) * 5 / 4);
    const std::string merged = folder.file("merged");
    runMapMerge({map, extended, merged});
    CHECK(blocks(merged) >= blocks(map) * 95 / 100);
    CHECK(blocks(merged) < blocks(map) * 5 / 4);
    // A volume that only one of them has comes along.
    std::filesystem::remove(map + "/volume.swm");
    runMapMerge({map, extended, folder.file("merged_with_one")});
    CHECK(blocks(folder.file("merged_with_one")) >= blocks(extended) * 95 / 100);
  }
  SECTION("never located, it is kept as it was, and the flight's own surface is apart from it") {
    settings.loop_stage.min_similarity = 1e3;
    const std::string extended = folder.file("extended");
    const ReplayResult second = fly(folder.file("second"), {extended, map, true}, settings);
    REQUIRE_FALSE(second.summary.at("counters").at("in_map").at("located_at_end").get<bool>());
    CHECK(blocks(extended) == blocks(map));
    const VoxelVolume before = readKeptVolumeFile(map + "/volume.swm");
    CHECK(shareWithin(before, readKeptVolumeFile(extended + "/volume.swm")) == 1);
    // The kept graph is solved with the flight's, which moves that by 10 um.
    CHECK(faces(second) == Approx(faces(first)).epsilon(0.05));
    CHECK_FALSE(std::filesystem::exists(folder.file("second/map_epoch_2147483648.ply")));
  }
  SECTION("what does not fit or is damaged is refused by name") {
    settings.map_stage.voxel_size = 0.1;
    CHECK_THROWS_WITH(fly(folder.file("x"), {"", map, false}, settings), Catch::Contains("map.voxel_size"));
    settings.map_stage.voxel_size = 0.05;
    std::string damaged = textOf(map + "/volume.swm");
    damaged[damaged.size() / 2] ^= 1;
    std::ofstream(map + "/volume.swm", std::ios::binary) << damaged;
    CHECK_THROWS_WITH(fly(folder.file("y"), {"", map, false}, settings), Catch::Contains("volume.swm"));
    for (const char* refused : {"x", "y"}) CHECK_FALSE(std::filesystem::exists(folder.file(refused)));
    CHECK_NOTHROW(fly(folder.file("z"), {"", map, false}));
  }
}

TEST_CASE("a threaded run in a map is repeated byte for byte, however late its log is written") {
  const ScratchFolder folder("known_map_threaded");
  const std::string map = folder.file("map");
  Settings settings = quick();
  settings.map.enabled = true;
  fly(folder.file("first"), {map, "", false}, settings);
  ReplayRequest request;
  request.log = shortLog();
  request.out = folder.file("run");
  request.real_time = true;
  request.speed = kSanitized ? 0.2 : 2;
  request.record = true;
  request.kept_maps.in = map;
  // Loop closure is done with a keyframe before the log has looked at it, or at the frames before it. The
  // pauses are shorter than what the log's queues hold.
  std::atomic<int> turns{0};
  ReplayHooks hooks;
  hooks.before_turn = [&turns](const char* node) {
    constexpr int kEvery = 15;
    constexpr auto kPause = std::chrono::milliseconds(200);
    if (std::string_view(node) == "log" && ++turns % kEvery == 0) std::this_thread::sleep_for(kPause);
    return true;
  };
  // A disk or a machine that others keep busy may cost records, which the recording says: what is incomplete
  // cannot be repeated, and says nothing about repetition.
  constexpr int kAttempts = 3;
  const auto lost = [](const ReplayResult& run) {
    std::string what;
    for (const auto& [arrow, count] : run.statistics.losses) {
      const bool kept = arrow.ends_with("_to_log") || arrow.ends_with("_to_record");
      if (kept || arrow.ends_with("_unrecorded")) what += fmt::format("{} {} ", count, arrow);
    }
    const auto& unwritten = run.summary.at("executor").at("recording").at("lost");
    return what + (unwritten.empty() ? "" : "unwritten " + unwritten.dump());
  };
  ReplayResult flown = runReplay(request, settings, hooks);
  for (int attempt = 1; attempt < kAttempts && !lost(flown).empty(); ++attempt) {
    WARN("flown again: lost " << lost(flown));
    flown = runReplay(request, settings, hooks);
  }
  INFO("lost in each of " << kAttempts << " attempts, the last: " << lost(flown));
  REQUIRE(lost(flown).empty());
  REQUIRE(flown.finished);
  REQUIRE(flown.summary.at("counters").at("in_map").at("located_at_end").get<bool>());
  ReplayRequest again;
  again.log = folder.file("run");
  again.out = folder.file("again");
  again.reproduce = true;
  REQUIRE(runReplay(again, Settings{}).finished);
  CHECK_FALSE(textOf(folder.file("run/in_map.tum")).empty());
  for (const char* file : {"odometry.tum", "in_map.tum", "map.tum", "map.ply"}) {
    CAPTURE(file);
    CHECK(textOf(folder.file("run/") + file) == textOf(folder.file("again/") + file));
  }
}

}  // namespace
}  // namespace swiftlet
