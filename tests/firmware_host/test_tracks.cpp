// Feature tracks through the whole program, and what the feeder adds to them.

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/recorded/track_file.hpp"
#include "firmware_host/commands/program.hpp"
#include "firmware_host/inputs/log/track_feeder.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "tests/firmware_host/run_program.hpp"
#include "tests/firmware_host/run_summary.hpp"
#include "tests/firmware_host/said.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

using test::run;
using test::summaryIn;
using test::textOf;

TEST_CASE("simulated tracks replay and evaluate from end to end") {
  const ScratchFolder folder("tracks");
  const std::string flight = folder.file("flight");
  const std::string first = folder.file("run");
  REQUIRE(run({"simulate", "--tracks", "--duration", "12", "--seed", "7", "--out", flight}) == kExitDone);
  REQUIRE(run({"replay", flight, "--out", first}) == kExitDone);
  CHECK(run({"evaluate", first}) == kExitDone);
  const auto summary = summaryIn(first);
  CHECK(summary["run"]["tracks"] == (fs::path(flight) / "mav0/tracks0/data.csv").string());
  CHECK(summary["run"]["cameras"] == 2);
  CHECK(summary["counters"]["odometry"]["frames"] == 238);  // 20 Hz from 0.1 s on
  CHECK(summary["counters"]["tracks"]["surplus"] == 0);
  CHECK(summary["run"]["tracking_coverage"].get<double>() > 0.9);
  // Half a pixel of noise over a few metres of path: millimetres to centimetres.
  const double ate = summary["accuracy"]["odometry"]["all"]["se3"]["ate_m"]["rmse"].get<double>();
  CHECK(ate > 0);
  CHECK(ate < 0.05);

  SECTION("a file given overrides the folder's own, with the same bytes as a result") {
    const std::string moved = folder.file("moved.csv");
    fs::rename(fs::path(flight) / "mav0/tracks0/data.csv", moved);
    CHECK(run({"replay", flight, "--out", folder.file("none")}) == kExitBadInput);
    CHECK_FALSE(fs::exists(folder.file("none")));
    const std::string again = folder.file("again");
    REQUIRE(run({"replay", flight, "--tracks", moved, "--out", again}) == kExitDone);
    CHECK(textOf(fs::path(again) / "odometry.tum") == textOf(fs::path(first) / "odometry.tum"));
    CHECK(run({"evaluate", again}) == kExitDone);
  }
  SECTION("one camera") {
    const std::string mono = folder.file("mono");
    REQUIRE(run({"replay", flight, "--mono", "--out", mono}) == kExitDone);
    CHECK(summaryIn(mono)["run"]["cameras"] == 1);
  }
  SECTION("tracks of another clock than the samples are refused, with the file and both spans") {
    const fs::path file = fs::path(flight) / "mav0/tracks0/data.csv";
    std::ofstream(file) << "#timestamp [ns],id,camera,u [px],v [px]\n5000000000,1,0,10,10\n"
                        << "5050000000,1,0,11,10\n";
    const test::Said said = test::say({"replay", flight, "--out", folder.file("none")});
    CHECK(said.code == kExitBadInput);
    CHECK_THAT(
        said.text,
        Catch::Contains(file.string() + ": timestamp: the log's samples (") &&
            Catch::Contains("the tracks (5000000000 to 5050000000) do not overlap in time. Use stamps"));
    CHECK_FALSE(fs::exists(folder.file("none")));
  }
  SECTION("a bad file is refused before a run folder is made") {
    std::ofstream(fs::path(flight) / "mav0/tracks0/data.csv", std::ios::app) << "oops\n";
    CHECK(run({"replay", flight, "--out", folder.file("none")}) == kExitBadInput);
    CHECK_FALSE(fs::exists(folder.file("none")));
  }
}

TEST_CASE("the run says how many tracks were too many") {
  const ScratchFolder folder("crowded");
  const std::string flight = folder.file("flight");
  REQUIRE(run({"simulate", "--tracks", "--duration", "3", "--out", flight}) == kExitDone);
  const fs::path file = fs::path(flight) / "mav0/tracks0/data.csv";
  TrackReader reader(file.string());
  TrackedFrame frame;
  std::uint64_t frames = 0;
  std::string crowd;
  for (; reader.next(frame); ++frames) {
    if (frames != 10) continue;
    for (int i = 0; i < 410; ++i) {
      crowd += std::to_string(frame.stamp.ns) + "," + std::to_string(1'000'000 + i) + ",0,5,5," +
               (frame.keyframe ? "1\n" : "0\n");
    }
  }
  // In front of the frame's own lines, which then are the surplus.
  std::string text = textOf(file);
  const std::string stamp = "\n" + crowd.substr(0, crowd.find(',') + 1);
  text.insert(text.find(stamp) + 1, crowd);
  std::ofstream(file, std::ios::binary) << text;
  ReplayRequest request;
  request.accuracy = runAccuracyJson;
  request.log = flight;
  request.out = folder.file("run");
  const ReplayResult result = runReplay(request, Settings{});
  CHECK(result.summary["counters"]["tracks"]["surplus"].get<std::uint64_t>() > 100);
  bool told = false;
  for (const auto& line : result.summary["warnings"]) {
    told = told || line.get<std::string>().find("only the first 400 are used") != std::string::npos;
  }
  CHECK(told);
}

/// Two landmarks that move by `step` px between frames 50 ms apart.
std::string movingTracks(double step, int frames, bool keyframes) {
  std::string text = keyframes ? "#timestamp,id,camera,u,v,keyframe\n" : "#timestamp,id,camera,u,v\n";
  for (int f = 0; f < frames; ++f) {
    for (const int id : {1, 2}) {
      text += std::to_string(50'000'000LL * f) + "," + std::to_string(id) + ",0," +
              std::to_string(10 * id + step * f) + ",5" + (keyframes ? (f == 3 ? ",1\n" : ",0\n") : "\n");
    }
  }
  return text;
}

std::vector<int> keyframesOf(const std::string& text) {
  TrackReader reader("tracks.csv", text);
  TrackFeeder feeder(&reader);
  std::vector<int> keyframes;
  int index = 0;
  while (const TrackedFrame* frame = feeder.dueBefore(Stamp{1'000'000'000'000})) {
    if (frame->keyframe) keyframes.push_back(index);
    ++index;
    feeder.take();
  }
  return keyframes;
}

TEST_CASE("keyframes come from the file, else from the reader's own rule") {
  CHECK(keyframesOf(movingTracks(1, 30, true)) == std::vector<int>{3});
  CHECK(keyframesOf(movingTracks(0, 42, false)) == std::vector<int>{0, 20, 40});  // 1 s at the latest
  CHECK(keyframesOf(movingTracks(6, 9, false)) == std::vector<int>{0, 4, 8});     // past 20 px
  CHECK(keyframesOf(movingTracks(90, 7, false)) == std::vector<int>{0, 3, 6});    // not before 0.14 s
}

}  // namespace
}  // namespace swiftlet
