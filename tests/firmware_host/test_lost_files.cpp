// A disk that fails costs a run its files one by one, and nothing else.

#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "drivers/input/input_error.hpp"
#include "firmware_host/files/lost_files.hpp"
#include "firmware_host/outputs/run_folder/run_recorder.hpp"
#include "firmware_host/runs/run_output.hpp"
#include "firmware_host/smoothing/map_keeper.hpp"
#include "tests/firmware_host/file_size_limit.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/mapping/memory_storage.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

using test::textOf;

NavState stateAt(std::int64_t ns) {
  NavState state;
  state.stamp = {ns};
  state.health = Health::kGood;
  return state;
}

/// A frame with a pose, and a keyframe that left the window.
void frameInto(RunRecorder& recorder, int i) {
  TrackedFrame frame;
  frame.stamp = {1'000'000 * i};
  OdometryOutput output;
  output.has_state = true;
  output.state = stateAt(frame.stamp.ns);
  KeyframeState keyframe;
  keyframe.state = output.state;
  REQUIRE(output.left_window.tryPushBack(keyframe));
  recorder.onFrame(frame, output);
}

Rig oneCamera() {
  Rig rig;
  rig.camera_count = 1;
  rig.camera[0] = CameraModel(CameraKind::kPinholeRadtan, 160, 120, {100, 100, 80, 60}, {0, 0, 0, 0});
  return rig;
}

}  // namespace

TEST_CASE("the first loss can be read by any thread while others come", "[files]") {
  LostFiles lost;
  CHECK(lost.problem() == nullptr);
  std::thread reader([&] {
    const char* seen = nullptr;
    while (seen == nullptr) seen = lost.problem();
    const std::string text = seen;
    CHECK((text == "a: full" || text == "b: full"));
  });
  std::thread other([&] { lost.add("a: full"); });
  lost.add("b: full");
  other.join();
  reader.join();
  CHECK(lost.count() == 2);
  LostFiles long_one;
  long_one.add(std::string(500, 'x'));
  CHECK(std::string(long_one.problem()).size() == LostFiles::kMostText - 1);
}

TEST_CASE("a stream that cannot be written ends with its name; the others go on", "[files]") {
  const ScratchFolder folder("lost");
  LostFiles lost;
  RunRecorder recorder(folder.path(), {.imu_rate = true}, lost);
  constexpr rlim_t kLimit = 8192;  // bytes: states.csv has them first
  constexpr int kFrames = 60;
  {
    const FileSizeLimit limit(kLimit);
    for (int i = 1; i <= kFrames; ++i) frameInto(recorder, i);
    recorder.onRemark({1}, "still there");
  }
  REQUIRE(lost.count() == 1);
  CHECK_THAT(lost.problem(), Catch::Contains("states.csv") && Catch::Contains("File too large"));
  const std::string poses = textOf(folder.file("odometry.tum"));
  CHECK(std::count(poses.begin(), poses.end(), '\n') == kFrames);
  CHECK_THAT(textOf(folder.file("events.log")), Catch::Contains("still there"));
  CHECK(fs::file_size(folder.file("states.csv")) <= kLimit);
}

TEST_CASE("a map whose blocks do not come back from disk is reported with its holes", "[files]") {
  const ScratchFolder folder("lost");
  testing::MemoryStorage storage;
  MapSettings settings;
  settings.volume_mib = 8;
  settings.surface_mib = 1;
  MapStage map(oneCamera(), settings, nullptr, &storage);
  map.submaps().follow({});
  StoredBlock block{};
  block.voxels.weight.fill(1);
  map.submaps().store(block);
  for (const bool readable : {true, false}) {
    storage.readable = readable;
    LostFiles lost;
    RunRecorder recorder(folder.path(), {}, lost);
    recorder.onMap(map, {});
    const std::uint64_t failed = recorder.map()["submaps"]["reads_failed"];
    CHECK((failed > 0) == !readable);
    REQUIRE((lost.problem() == nullptr) == readable);
    if (!readable) CHECK_THAT(lost.problem(), Catch::Contains("could not be read back from disk"));
  }
}

TEST_CASE("without a folder a run writes nothing and goes on", "[files]") {
  LostFiles lost;
  RunRecorder recorder("", {.imu_rate = true, .fly_on = true}, lost);
  frameInto(recorder, 1);
  recorder.onRemark({1}, "nobody reads this");
  recorder.onLocalMesh({});
  const std::array<std::byte, 3> bytes{};
  CHECK_FALSE(recorder.storage().write(0, bytes));
  CHECK(lost.count() == 0);  // said by whoever could not make the folder
}

TEST_CASE("a folder that takes no file costs each of them, or the run where it has not begun", "[files]") {
  const ScratchFolder folder("lost");
  const std::string gone = folder.file("not_there");
  LostFiles lost;
  const Settings settings;
  Calibration calibration;
  calibration.rig = oneCamera();
  CHECK_THROWS_AS(RunOutput(gone, settings, calibration, {.imu_rate = true}, {}, lost), InputError);
  RunOutput output(gone, settings, calibration, {.imu_rate = true, .fly_on = true}, {}, lost);
  CHECK(lost.count() >= 6);  // settings.yaml, four streams, keyframes.swk
  CHECK_THAT(lost.problem(), Catch::Contains("No such file or directory"));
  CHECK(output.startRecorder(RecordOrder::kByArrival) != nullptr);  // makes its folders itself
  CHECK_FALSE(output.canSmooth());
  CHECK_FALSE(output.observer().wantsImu());
}

TEST_CASE("a recorder that cannot begin is lost, not the flight", "[files]") {
  const ScratchFolder folder("lost");
  std::ofstream(folder.file("recording")) << "a file in the recording's place";
  LostFiles lost;
  const Settings settings;
  Calibration calibration;
  calibration.rig = oneCamera();
  RunOutput output(folder.path(), settings, calibration, {.fly_on = true}, {}, lost);
  CHECK(output.startRecorder(RecordOrder::kByArrival) == nullptr);
  REQUIRE(lost.problem() != nullptr);
  CHECK_THAT(lost.problem(), Catch::Contains("recording"));
}

TEST_CASE("a summary that finds no room leaves no half of one", "[files]") {
  const ScratchFolder folder("lost");
  LostFiles lost;
  const Settings settings;
  Calibration calibration;
  calibration.rig = oneCamera();
  RunOutput output(folder.path(), settings, calibration, {.fly_on = true}, {}, lost);
  RunFacts facts;
  output.close(facts);
  constexpr rlim_t kLimit = 1000;
  const FileSizeLimit limit(kLimit);
  output.writeSummary(output.summary(facts));
  CHECK_FALSE(fs::exists(folder.file("summary.json")));
  CHECK_FALSE(fs::exists(folder.file("summary.json.part")));
  REQUIRE(lost.problem() != nullptr);
  CHECK_THAT(lost.problem(), Catch::Contains("summary.json"));
}

TEST_CASE("keyframes that find no room end their file, said once", "[files]") {
  const ScratchFolder folder("lost");
  LostFiles lost;
  ImuNoise noise;
  MapKeeper keeper(folder.path(), oneCamera(), noise, OdometrySettings{}, lost);
  TrackedFrame frame;
  for (TrackId id = 0; id < 300; ++id) {
    TrackedFeature feature;
    feature.id = id;
    REQUIRE(frame.features.tryPushBack(feature));
  }
  constexpr rlim_t kLimit = 100'000;
  {
    const FileSizeLimit limit(kLimit);
    for (int i = 1; i < 50; ++i) {
      frame.stamp = {i};
      keeper.addKeyframe(frame, stateAt(i), {});
    }
    keeper.finish();
  }
  CHECK(lost.count() == 1);
  CHECK_THAT(lost.problem(), Catch::Contains("keyframes.swk") && Catch::Contains("File too large"));
}

}  // namespace swiftlet
