// Whose a run folder is: nothing that a run did not write is removed, no flight is overwritten, two flights
// never share a folder, and old ones go only where a setting says so.

#include <atomic>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "firmware_host/files/run_claim.hpp"
#include "firmware_host/runs/fly_run.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

constexpr std::time_t kNow = 1795449852;  // 2026-11-23 16:04:12 UTC
constexpr std::uint64_t kEverything = std::uint64_t{1} << 62U;

void write(const fs::path& path, const std::string& text = "x") {
  fs::create_directories(path.parent_path());
  std::ofstream(path) << text;
}

std::set<std::string> namesIn(const std::string& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_directory()) names.insert(fs::relative(entry.path(), folder).string());
  }
  return names;
}

const std::vector<std::string>& runFiles() {
  static const std::vector<std::string> kFiles = {"odometry.tum",
                                                  "states.csv",
                                                  "events.log",
                                                  "settings.yaml",
                                                  "summary.json",
                                                  "map.tum",
                                                  "loops.csv",
                                                  "map.ply",
                                                  "map.glb",
                                                  "map_epoch_3.ply",
                                                  "keyframes.swk",
                                                  "local_mesh.ply",
                                                  "estimated_calibration/cam0/sensor.yaml",
                                                  "meshes/frames.csv",
                                                  "meshes/frame_000001.ply",
                                                  "meshes/horizon_000001.ply",
                                                  "recording/recording_000000.swr"};
  return kFiles;
}

}  // namespace

TEST_CASE("a replay into the folder of an earlier one leaves nothing of that", "[files]") {
  const ScratchFolder folder("claim");
  { const RunClaim first(folder.path(), RunKind::kReplay, false); }
  for (const std::string& name : runFiles()) write(folder.file(name));
  const RunClaim again(folder.path(), RunKind::kReplay, false);
  CHECK(namesIn(folder.path()) == std::set<std::string>{kRunMark});
  CHECK_FALSE(fs::exists(folder.file("recording")));
  CHECK(runKindOf(folder.path()) == RunKind::kReplay);
}

TEST_CASE("what no run writes stays, wherever it lies", "[files]") {
  const ScratchFolder folder("claim");
  { const RunClaim first(folder.path(), RunKind::kReplay, false); }
  const std::set<std::string> foreign = {
      "notes.txt",          "meshes/holiday.ply",    "meshes/frame_best.ply",
      "recording/song.mp3", "map_epoch_of_rome.ply", "plots/odometry.tum"};
  for (const std::string& name : foreign) write(folder.file(name));
  for (const std::string& name : runFiles()) write(folder.file(name));
  const RunClaim again(folder.path(), RunKind::kReplay, true);
  std::set<std::string> left = foreign;
  left.insert(kRunMark);
  CHECK(namesIn(folder.path()) == left);
}

TEST_CASE("files under a run's names without its mark are refused until told to", "[files]") {
  for (const std::string& name : runFiles()) {
    INFO(name);
    const ScratchFolder folder("claim");
    write(folder.file(name), "not ours");
    CHECK_THROWS_WITH((RunClaim(folder.path(), RunKind::kReplay, false)),
                      Catch::Contains(folder.path()) && Catch::Contains("--replace"));
    CHECK_THROWS_AS(refuseRunIn(folder.path()), InputError);
    CHECK(namesIn(folder.path()) == std::set<std::string>{name});
  }
}

TEST_CASE("a folder without a run may hold anything else", "[files]") {
  const ScratchFolder folder("claim");
  write(folder.file("notes.txt"));
  refuseRunIn(folder.path());
  refuseRunIn(folder.file("not_there"));
  const RunClaim claim(folder.path(), RunKind::kFlight, false);
  CHECK(namesIn(folder.path()) == std::set<std::string>{"notes.txt", kRunMark});
}

TEST_CASE("a flight is replaced by nothing that was not told to", "[files]") {
  const ScratchFolder folder("claim");
  { const RunClaim flight(folder.path(), RunKind::kFlight, false); }
  write(folder.file("odometry.tum"), "the flight");
  for (const RunKind kind : {RunKind::kReplay, RunKind::kFlight}) {
    CHECK_THROWS_WITH((RunClaim(folder.path(), kind, false)), Catch::Contains("already holds a flight"));
  }
  CHECK(fs::exists(folder.file("odometry.tum")));
  const RunClaim told(folder.path(), RunKind::kReplay, true);
  CHECK_FALSE(fs::exists(folder.file("odometry.tum")));
  CHECK(runKindOf(folder.path()) == RunKind::kReplay);
  CHECK_THROWS_AS(refuseRunIn(folder.path()), InputError);  // a flight spares a replay too
}

TEST_CASE("no run is written into a log", "[files]") {
  const ScratchFolder folder("claim");
  write(folder.file("mav0/imu0/data.csv"));
  for (const char* place : {".", "mav0", "mav0/", "mav0/imu0"}) {
    INFO(place);
    for (const bool replace : {false, true}) {
      CHECK_THROWS_WITH((RunClaim(folder.file(place), RunKind::kReplay, replace)),
                        Catch::Contains("is a log"));
    }
    CHECK_THROWS_WITH(refuseRunIn(folder.file(place)), Catch::Contains("is a log"));
  }
  CHECK(namesIn(folder.path()) == std::set<std::string>{"mav0/imu0/data.csv"});
}

TEST_CASE("fly refuses a folder with a run before it looks at anything else, unless told to replace it",
          "[files]") {
  const ScratchFolder folder("claim");
  { const RunClaim earlier(folder.path(), RunKind::kReplay, false); }
  FlyRequest request;
  request.out = folder.path();
  CHECK_THROWS_WITH(runFlight(request, Settings{}), Catch::Contains("already holds a replay"));
  request.replace = true;
  CHECK_THROWS_WITH(runFlight(request, Settings{}), Catch::Contains("vehicle.calibration"));
}

TEST_CASE("a flight's name has the time where the clock was set", "[files]") {
  CHECK(flightName(12, kNow) == "000012_20261123T160412Z");
  CHECK(flightName(12, 0) == "000012");
  CHECK(flightName(7, 946684800) == "000007");  // 2000: a board that starts there
}

TEST_CASE("each flight has a folder of its own", "[files]") {
  const ScratchFolder folder("claim");
  const std::string parent = folder.file("flights");
  CHECK(fs::path(makeFlightFolder(parent, kNow)).filename() == "000001_20261123T160412Z");
  CHECK(fs::path(makeFlightFolder(parent, kNow)).filename() == "000002_20261123T160412Z");
  CHECK(fs::path(makeFlightFolder(parent, 0)).filename() == "000003");
  write(parent + "/000041_holiday/photo.jpg");
  write(parent + "/000040", "a file");
  CHECK(fs::path(makeFlightFolder(parent, kNow)).filename() == "000004_20261123T160412Z");
  fs::create_directories(parent + "/000009");
  CHECK(fs::path(makeFlightFolder(parent, 0)).filename() == "000010");
}

TEST_CASE("many that start at once get a folder each", "[files]") {
  const ScratchFolder folder("claim");
  constexpr std::size_t kThreads = 8;
  constexpr int kEach = 20;
  std::vector<std::vector<std::string>> made(kThreads);
  std::atomic<bool> go{false};
  std::vector<std::thread> threads;
  for (std::size_t t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      while (!go.load()) std::this_thread::yield();
      for (int i = 0; i < kEach; ++i) made[t].push_back(makeFlightFolder(folder.path(), kNow));
    });
  }
  go = true;
  for (std::thread& thread : threads) thread.join();
  std::set<std::string> all;
  for (const auto& names : made) all.insert(names.begin(), names.end());
  CHECK(all.size() == kThreads * kEach);
}

TEST_CASE("without a folder to be had the reason is said", "[files]") {
  const ScratchFolder folder("claim");
  write(folder.file("file"));
  CHECK_THROWS_WITH(makeFlightFolder(folder.file("file/flights"), kNow), Catch::Contains("Not a directory"));
}

TEST_CASE("old flights go oldest first, and only flights that nobody uses", "[files]") {
  const ScratchFolder folder("claim");
  const std::string& parent = folder.path();
  const std::string oldest = makeFlightFolder(parent, kNow);
  { const RunClaim claim(oldest, RunKind::kFlight, false); }
  write(oldest + "/recording/recording_000000.swr");
  const std::string replayed = makeFlightFolder(parent, kNow);
  { const RunClaim claim(replayed, RunKind::kReplay, false); }
  const std::string unmarked = makeFlightFolder(parent, kNow);
  const std::string flying = makeFlightFolder(parent, kNow);
  const RunClaim in_flight(flying, RunKind::kFlight, false);
  const std::string outside = folder.file("mine");
  { const RunClaim claim(outside, RunKind::kFlight, false); }
  const std::string newer = makeFlightFolder(parent, kNow);
  { const RunClaim claim(newer, RunKind::kFlight, false); }
  const std::string current = makeFlightFolder(parent, kNow);
  { const RunClaim claim(current, RunKind::kFlight, false); }
  fs::create_directory_symlink(outside, parent + "/000000");

  CHECK(freeOldFlights(parent, 0, current).empty());
  CHECK(fs::exists(oldest));

  const std::vector<std::string> lines = freeOldFlights(parent, kEverything, current);
  REQUIRE(lines.size() == 3);
  CHECK_THAT(lines[0], Catch::StartsWith(oldest + ": deleted"));
  CHECK_THAT(lines[1], Catch::StartsWith(newer + ": deleted"));
  CHECK_THAT(lines[2], Catch::Contains("flights.keep_free_mib"));
  CHECK_FALSE(fs::exists(oldest));
  CHECK_FALSE(fs::exists(newer));
  for (const std::string& left : {replayed, unmarked, flying, outside, current}) CHECK(fs::exists(left));
  CHECK(fs::exists(outside + "/" + kRunMark));
}

}  // namespace swiftlet
