// Full smoothing after the run, from keyframes.swk: the same bytes as at the run's end; interrupted and
// refused without harm; and what a run keeps when its files find no room.

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "drivers/input/input_error.hpp"
#include "estimator/odometry/odometry_inputs.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "firmware_host/runs/smooth_run.hpp"
#include "firmware_host/smoothing/map_keeper.hpp"
#include "tests/firmware_host/file_size_limit.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/smoother/revisit_flight.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

using test::textOf;

ReplayRequest requestFor(const std::string& out) {
  ReplayRequest request;
  request.log = shortLog();
  request.out = out;
  return request;
}

nlohmann::json summaryIn(const std::string& run) {
  return nlohmann::json::parse(textOf(run + "/summary.json"));
}

}  // namespace

TEST_CASE("smoothing later gives the bytes of the run's own") {
  const ScratchFolder folder("smooth");
  const std::string run = folder.file("run");
  REQUIRE(runReplay(requestFor(run), Settings{}).finished);
  const std::string map = textOf(run + "/map.tum");
  const nlohmann::json figures = summaryIn(run)["counters"]["full_smoothing"];
  REQUIRE_FALSE(map.empty());
  REQUIRE(figures["keyframes"].get<int>() > 3);

  nlohmann::json without = summaryIn(run);
  without["counters"].erase("full_smoothing");
  without["timing"].erase("full_smoothing");
  std::ofstream(run + "/summary.json") << without.dump(2);
  fs::remove(run + "/map.tum");
  const FullSmoothing found = runSmooth({.run = run}, Settings{});
  CHECK(found.problem.empty());
  CHECK(found.cut.empty());
  CHECK(textOf(run + "/map.tum") == map);
  CHECK(summaryIn(run)["counters"]["full_smoothing"] == figures);
  CHECK(summaryIn(run)["timing"].contains("full_smoothing"));
}

TEST_CASE("loops come back from the file and tie the keyframes as they did in memory") {
  const ScratchFolder folder("smooth");
  SimulationSettings flown = test::roomFlight(28, 1);
  flown.tracks.max_tracks = 80;
  flown.tracks.landmarks = 2000;
  const test::TrackFlight flight(flown);
  OdometrySettings settings;
  FullSmoother memory(flight.rig(), inflatedNoise(flight.noise(), settings), {});
  LostFiles lost;
  MapKeeper keeper(folder.path(), flight.rig(), flight.noise(), settings, lost);
  std::vector<std::size_t> keyframes;
  flight.play(
      [&](const ImuSample& sample) {
        memory.addImu(sample);
        keeper.addImu(sample);
      },
      [&](std::size_t k) {
        const TrackedFrame& frame = flight.frames()[k];
        if (!frame.keyframe) return;
        const BodyState x = flight.truth(k);
        NavState state;
        state.stamp = frame.stamp;
        state.T_world_body = x.T_world_body;
        state.v_world_body = x.v_world_body;
        const NoiseInUse noise{0.6, {1.5, k % 2 == 0 ? 1.0 : 2.0}};
        memory.addKeyframe(frame, state, noise);
        keeper.addKeyframe(frame, state, noise);
        keyframes.push_back(k);
      });
  const std::vector<LoopRevisit> loops = trueLoops(flight, keyframes, {});
  REQUIRE(loops.size() > 3);
  for (const LoopRevisit& loop : loops) {
    REQUIRE(memory.addRevisit(loop).ok());
    keeper.addRevisit(loop);
  }
  keeper.finish();
  FullSmootherReport report;
  REQUIRE(memory.solve(report).ok());
  REQUIRE(report.revisits_used > 0);
  const FullSmoothing file = smoothKeyframes(folder.file(kKeyframeFile), smoothingOptions(Settings{}, false));
  CHECK(file.report.revisits_used == report.revisits_used);
  CHECK(file.report.matches_used == report.matches_used);
  REQUIRE(file.poses.size() == memory.size());
  for (std::size_t k = 0; k < memory.size(); ++k) {
    const NavState solved = memory.state(k);
    REQUIRE(file.poses[k].stamp == solved.stamp);
    REQUIRE(file.poses[k].T_world_body.translation == solved.T_world_body.translation);
    REQUIRE(file.poses[k].T_world_body.rotation.coeffs() == solved.T_world_body.rotation.coeffs());
  }
}

TEST_CASE("what a killed run left is smoothed up to where it was cut off") {
  const ScratchFolder folder("smooth");
  const std::string run = folder.file("run");
  REQUIRE(runReplay(requestFor(run), Settings{}).finished);
  const std::string kept = run + "/" + kKeyframeFile;
  const auto whole = summaryIn(run)["counters"]["full_smoothing"]["keyframes"].get<std::size_t>();
  fs::resize_file(kept, fs::file_size(kept) / 2);
  fs::remove(run + "/summary.json");
  const FullSmoothing found = runSmooth({.run = run}, Settings{});
  CHECK_FALSE(found.cut.empty());
  CHECK(found.poses.size() > 3);
  CHECK(found.poses.size() < whole);
  CHECK_FALSE(fs::exists(run + "/summary.json"));
}

TEST_CASE("a solve that is stopped ends without a result, and the folder stays") {
  const ScratchFolder folder("smooth");
  const std::string run = folder.file("run");
  REQUIRE(runReplay(requestFor(run), Settings{}).finished);
  const std::string map = textOf(run + "/map.tum");
  const std::string summary = textOf(run + "/summary.json");

  std::atomic<bool> stop{false};
  FullSmoothingOptions options = smoothingOptions(Settings{}, false);
  options.stop = &stop;
  bool begun = false;
  options.begins = [&](std::size_t keyframes, std::size_t bytes) {
    CHECK(keyframes > 3);
    CHECK(bytes > 0);
    begun = true;
    stop = true;  // in the middle of it, as far as the solver can tell
  };
  const FullSmoothing stopped = smoothKeyframes(run + "/" + kKeyframeFile, options);
  CHECK(begun);
  CHECK(stopped.poses.empty());
  CHECK(stopped.problem == kFullSmoothingStopped);
  CHECK(stopped.report.iterations == 0);

  CHECK(runSmooth({.run = run, .stop = &stop}, Settings{}).problem == kFullSmoothingStopped);
  CHECK(textOf(run + "/map.tum") == map);
  CHECK(textOf(run + "/summary.json") == summary);
}

TEST_CASE("a run that was stopped has its summary and can be smoothed later") {
  const ScratchFolder folder("smooth");
  const std::string run = folder.file("run");
  std::atomic<bool> stop{false};
  ReplayRequest request = requestFor(run);
  request.stop = &stop;
  int frames = 0;
  ReplayHooks hooks;
  hooks.drag = [&](StageId stage, double) {
    if (stage == StageId::kTrack && ++frames == 40) stop = true;
  };
  const ReplayResult result = runReplay(request, Settings{}, hooks);
  REQUIRE_FALSE(result.finished);
  CHECK_FALSE(fs::exists(run + "/map.tum"));
  CHECK(summaryIn(run)["counters"]["faults"].contains(kFullSmoothingStopped));
  CHECK_FALSE(runSmooth({.run = run}, Settings{}).poses.empty());
  CHECK(fs::exists(run + "/map.tum"));
}

TEST_CASE("more memory than allowed is refused before it is taken, with the remedy") {
  const ScratchFolder folder("smooth");
  const std::string run = folder.file("run");
  Settings small;
  small.full_memory_mib = 1;
  const ReplayResult result = runReplay(requestFor(run), small);
  CHECK(result.finished);
  CHECK_FALSE(fs::exists(run + "/map.tum"));
  const FullSmoothing refused = runSmooth({.run = run}, small);
  CHECK(refused.poses.empty());
  CHECK_THAT(refused.problem, Catch::Contains("MiB") && Catch::Contains("--set smoother.full_memory_mib="));
  CHECK_FALSE(runSmooth({.run = run}, Settings{}).poses.empty());
}

TEST_CASE("a long flight is refused whole, or smoothed whole") {
  const ScratchFolder folder("smooth");
  const test::TrackFlight flight(test::roomFlight(1, 1));
  constexpr std::size_t kKeyframes = 4100;
  LostFiles lost;
  MapKeeper keeper(folder.path(), flight.rig(), flight.noise(), {}, lost);
  TrackedFrame frame = flight.frames()[0];
  frame.features.resize(8);
  for (std::size_t k = 1; k <= kKeyframes; ++k) {
    frame.stamp = Stamp{static_cast<std::int64_t>(k) * 150'000'000};
    NavState state;
    state.stamp = frame.stamp;
    keeper.addKeyframe(frame, state, {});
  }
  keeper.finish();
  const std::string kept = folder.file(kKeyframeFile);
  FullSmoothingOptions options = smoothingOptions(Settings{}, false);
  options.most_bytes = std::size_t{20} << 20U;
  const FullSmoothing refused = smoothKeyframes(kept, options);
  CHECK(refused.poses.empty());
  CHECK_THAT(refused.problem, Catch::Contains("of 4100 keyframes"));
  // Most of the file was not kept; the remedy is enough for all of it.
  const std::string_view remedy = "full_memory_mib=";
  const std::size_t at = refused.problem.find(remedy);
  REQUIRE(at != std::string::npos);
  const std::size_t mebibytes = std::stoul(refused.problem.substr(at + remedy.size()));
  options.most_bytes = mebibytes << 20U;
  CHECK(smoothKeyframes(kept, options).poses.size() == kKeyframes);
}

TEST_CASE("a replay removes neither the recording that it reads nor what is not its own") {
  const ScratchFolder folder("smooth");
  const std::string run = folder.file("run");
  ReplayRequest request = requestFor(run);
  request.record = true;
  request.until = 0.5;
  REQUIRE(runReplay(request, Settings{}).finished);
  for (const std::string& log : {run, run + "/recording"}) {
    ReplayRequest own = requestFor(run);
    own.log = log;
    own.replace = true;
    CHECK_THROWS_WITH(runReplay(own, Settings{}), Catch::Contains("is the folder of the recording"));
  }
  CHECK(fs::exists(run + "/recording/recording_000000.swr"));
  // Without --record there is no recording of another run beside this one's files.
  request.record = false;
  REQUIRE(runReplay(request, Settings{}).finished);
  CHECK_FALSE(fs::exists(run + "/recording"));
}

TEST_CASE("a folder without keyframes and a foreign file are refused") {
  const ScratchFolder folder("smooth");
  CHECK_THROWS_AS(runSmooth({.run = folder.path()}, Settings{}), InputError);
  std::ofstream(folder.file(kKeyframeFile)) << "not keyframes at all, but long enough";
  CHECK_THROWS_WITH(runSmooth({.run = folder.path()}, Settings{}), Catch::Contains("magic"));
}

TEST_CASE("files that run full in the middle of a run on threads end by name, and the run goes on") {
  const ScratchFolder folder("smooth");
  const std::string run = folder.file("run");
  ReplayRequest request = requestFor(run);
  request.real_time = true;
  request.imu_rate = true;
  request.record = true;
  ReplayResult result;
  {
    constexpr rlim_t kLimit =
        75'000;  // bytes: the short streams and the summary stay below it, the others do not
    const FileSizeLimit limit(kLimit);
    result = runReplay(request, Settings{});
  }
  CHECK(result.finished);
  CHECK_FALSE(result.lost.empty());
  const auto executor = summaryIn(run)["executor"];
  CHECK(executor["thread_faults"].empty());
  CHECK(executor["files"]["lost"].get<int>() == 2);  // keyframes.swk and imu_rate.tum, each said once
  CHECK_FALSE(executor["recording"]["error"].get<std::string>().empty());
  const std::string poses = textOf(run + "/odometry.tum");
  CHECK(static_cast<std::uint64_t>(std::count(poses.begin(), poses.end(), '\n')) == result.statistics.poses);
  CHECK(result.statistics.poses > 0);
}

}  // namespace swiftlet
