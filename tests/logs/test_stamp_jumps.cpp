// Stamps that jump: one message an hour ahead, a stream ahead and back, everything back for good. Whatever
// jumps, a good pose is there again within a bounded time, and the run repeats byte for byte.

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "drivers/recorded/open_log.hpp"
#include "drivers/recorded/recording_source.hpp"
#include "drivers/recorded/recording_writer.hpp"
#include "estimator/core/random.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/sanitized.hpp"
#include "tests/support/long_run.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

using test::textOf;

constexpr double kForGood = 1e9;
constexpr Duration kHour{3'600'000'000'000};
constexpr std::size_t kStreams = 1 + kMaxCameras;  // IMU, camera 0, camera 1
using Streams = std::array<bool, kStreams>;
constexpr Streams kImu{true, false, false};
constexpr Streams kCamera0{false, true, false};
constexpr Streams kCamera1{false, false, true};
constexpr Streams kAll{true, true, true};

/// Messages whose stamps lie in [from, until) seconds of the log are stamped otherwise.
struct Jump {
  Streams streams{};
  double from = 0;
  double until = kForGood;
  Duration by;
};

/// The short log as a recording, in its own order.
void recordWithJumps(const std::string& folder, const std::vector<Jump>& jumps) {
  const auto log = openLog(shortLog());
  RecordingHeader header;
  header.rig = log->rig();
  header.noise = log->imuNoise();
  header.order = RecordOrder::kAsWritten;
  RecordingWriter writer(folder, header);
  SensorMessage message;
  Stamp first{std::numeric_limits<std::int64_t>::min()};
  while (log->next(message)) {
    auto* frame = std::get_if<CameraFrame>(&message);
    Stamp& stamp = frame != nullptr ? frame->stamp : std::get<ImuSample>(message).stamp;
    if (first.ns == std::numeric_limits<std::int64_t>::min()) first = stamp;
    const Stamp arrival = stamp;
    const std::size_t stream = frame != nullptr ? 1 + frame->camera : 0;
    for (const Jump& jump : jumps) {
      const double at = (arrival - first).seconds();
      if (jump.streams[stream] && at >= jump.from && at < jump.until) stamp = stamp + jump.by;
    }
    const Status status =
        frame != nullptr ? writer.image(*frame) : writer.imu(std::get<ImuSample>(message), arrival);
    REQUIRE(status.ok());
  }
  REQUIRE(writer.end().ok());
}

/// Replayed in lockstep, twice, and repeated step by step: all with the same bytes.
ReplayResult replayed(const ScratchFolder& folder, const std::vector<Jump>& jumps) {
  recordWithJumps(folder.file("log"), jumps);
  ReplayRequest request;
  request.log = folder.file("log");
  request.out = folder.file("run");
  request.imu_rate = true;
  request.record = true;
  ReplayResult result = runReplay(request, Settings{});
  REQUIRE(result.finished);
  request.record = false;
  request.out = folder.file("again");
  REQUIRE(runReplay(request, Settings{}).finished);
  request.log = folder.file("run");
  request.out = folder.file("repeated");
  request.reproduce = true;
  REQUIRE(runReplay(request, Settings{}).finished);
  for (const char* file : {"odometry.tum", "states.csv", "imu_rate.tum", "map.tum"}) {
    INFO(file);
    CHECK(textOf(folder.file("run/") + file) == textOf(folder.file("again/") + file));
    CHECK(textOf(folder.file("run/") + file) == textOf(folder.file("repeated/") + file));
  }
  return result;
}

struct Pose {
  double stamp = 0;
  Eigen::Vector3d p;
};

std::vector<Pose> posesOf(const std::string& run) {
  std::ifstream file(run + "/odometry.tum");
  std::vector<Pose> poses;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream text(line);
    Pose pose;
    text >> pose.stamp >> pose.p[0] >> pose.p[1] >> pose.p[2];
    poses.push_back(pose);
  }
  return poses;
}

/// The last second has a pose for each image, the log's last one included, and they tell of the same motion
/// as those of the log without jumps.
void checkBack(const ScratchFolder& folder, const ReplayResult& result, Duration shifted = {}) {
  REQUIRE_FALSE(result.statistics.health.empty());
  CHECK(result.statistics.health.back().health == Health::kGood);
  static const std::vector<Pose> clean = [] {
    const ScratchFolder plain("stamps_plain");
    recordWithJumps(plain.file("log"), {});
    ReplayRequest request;
    request.log = plain.file("log");
    request.out = plain.file("run");
    REQUIRE(runReplay(request, Settings{}).finished);
    return posesOf(plain.file("run"));
  }();
  const std::vector<Pose> poses = posesOf(folder.file("run"));
  constexpr std::size_t kFrames = 15;  // the last 0.7 s
  REQUIRE(poses.size() > kFrames);
  for (std::size_t i = 1; i <= kFrames; ++i) {
    const Pose& pose = poses[poses.size() - i];
    const Pose& same = clean[clean.size() - i];
    CHECK(std::abs(pose.stamp - shifted.seconds() - same.stamp) < 1e-5);
    const double moved = (pose.p - poses[poses.size() - kFrames].p).norm();
    const double truly = (same.p - clean[clean.size() - kFrames].p).norm();
    CHECK(std::abs(moved - truly) < 0.03);
  }
}

std::uint64_t restartsOf(const ReplayResult& result) {
  const auto found = result.statistics.events.find(EventKind::kStampsWentBack);
  return found == result.statistics.events.end() ? 0 : found->second.count;
}

}  // namespace

TEST_CASE("one sample or image an hour ahead is held out, and nothing else is lost") {
  const Streams streams = GENERATE(values<Streams>({kImu, kCamera0, kCamera1}));
  const ScratchFolder folder("stamps_one");
  // Around one message: half a width is less than half a period.
  const double half = streams == kImu ? 0.002 : 0.02;
  const ReplayResult result = replayed(folder, {{streams, 1.5 - half, 1.5 + half, kHour}});
  checkBack(folder, result);
  CHECK(restartsOf(result) == 0);
  CHECK(result.statistics.health.back().epoch == 0);
  const char* loss = streams == kImu       ? "imu_stamps_held_out"
                     : streams == kCamera0 ? "camera_0_stamps_held_out"
                                           : "camera_1_stamps_held_out";
  REQUIRE(result.statistics.losses.contains(loss));
  CHECK(result.statistics.losses.at(loss) == 1);
}

TEST_CASE("the log's first messages an hour ahead are got over") {
  const Streams streams = GENERATE(values<Streams>({kImu, kCamera0, kCamera1, kAll}));
  const ScratchFolder folder("stamps_first");
  const ReplayResult result = replayed(folder, {{streams, 0, 0.004, kHour}});
  checkBack(folder, result);
}

TEST_CASE("one camera's stream an hour ahead and back costs that camera's images, not the estimate") {
  const Streams streams = GENERATE(values<Streams>({kCamera0, kCamera1}));
  const Duration by = GENERATE(values<Duration>({kHour, -kHour}));
  const ScratchFolder folder("stamps_camera");
  const ReplayResult result = replayed(folder, {{streams, 0.7, 2.7, by}});
  checkBack(folder, result);
  CHECK(result.statistics.health.back().epoch == 0);
  CHECK(result.statistics.events.at(EventKind::kCameraLost).count == 1);
  CHECK(result.statistics.events.at(EventKind::kCameraBack).count == 1);
}

TEST_CASE("the IMU's stream an hour ahead and back begins a new epoch, said with the seconds") {
  const ScratchFolder folder("stamps_imu");
  const ReplayResult result = replayed(folder, {{kImu, 0.7, 2.2, kHour}});
  checkBack(folder, result);
  CHECK(restartsOf(result) == 1);
  CHECK(result.statistics.events.at(EventKind::kStampsWentBack).value == Approx(3600).margin(1));
  CHECK(result.statistics.health.back().epoch >= 1);
  CHECK(textOf(folder.file("run/events.log")).find("stamps_went_back 3599.") != std::string::npos);
}

TEST_CASE("all streams back for good begin a new epoch on the new stamps") {
  const Duration by = GENERATE(values<Duration>({-kHour, {-1'000'000'000}, {-300'000'000}}));
  const ScratchFolder folder("stamps_all");
  const ReplayResult result = replayed(folder, {{kAll, 1.7, kForGood, by}});
  checkBack(folder, result, by);
  CHECK(restartsOf(result) == 1);
  CHECK(result.statistics.health.back().epoch == 1);
}

TEST_CASE("all streams ahead for good are a gap") {
  const ScratchFolder folder("stamps_ahead");
  const ReplayResult result = replayed(folder, {{kAll, 1.7, kForGood, kHour}});
  checkBack(folder, result, kHour);
  CHECK(restartsOf(result) == 0);
}

TEST_CASE("a threaded run whose stamps jump is repeated byte for byte") {
  const Jump jump =
      GENERATE(values<Jump>({{kAll, 1.7, kForGood, Duration{-300'000'000}}, {kCamera0, 0.7, 2.2, kHour}}));
  const ScratchFolder folder("stamps_threaded");
  recordWithJumps(folder.file("log"), {jump});
  ReplayRequest request;
  request.log = folder.file("log");
  request.out = folder.file("run");
  request.real_time = true;
  request.speed = kSanitized ? 0.2 : 1;
  request.record = true;
  const ReplayResult result = runReplay(request, Settings{});
  REQUIRE(result.finished);
  CHECK(restartsOf(result) == (jump.streams == kAll ? 1 : 0));
  CHECK(result.statistics.losses.contains("camera_0_stamps_held_out") == (jump.streams == kCamera0));
  // A disk that stands still costs records.
  if (openRecording(folder.file("run"))->firstLoss()) return;
  request = {};
  request.log = folder.file("run");
  request.out = folder.file("repeated");
  request.reproduce = true;
  REQUIRE(runReplay(request, Settings{}).finished);
  for (const char* file : {"odometry.tum", "states.csv", "map.tum", "local_mesh.ply"}) {
    INFO(file);
    CHECK(textOf(folder.file("run/") + file) == textOf(folder.file("repeated/") + file));
  }
}

TEST_CASE("after jumps of any stream by any time a good pose comes back", "[long]") {
  for (int run = 0; run < (kSanitized ? 1 : longOr(20, 3)); ++run) {
    INFO("run " << run);
    Random random(31, static_cast<std::uint64_t>(run));
    std::vector<Jump> jumps;
    for (std::uint32_t n = 1 + random.below(4); n > 0; --n) {
      Jump jump;
      for (bool& stream : jump.streams) stream = random.below(2) == 0;
      jump.from = random.uniform(0, 2);
      jump.until = std::min(2.0, jump.from + random.uniform(0.001, 1));
      const double seconds = std::pow(10, random.uniform(-1, 4)) * (random.below(2) == 0 ? 1 : -1);
      jump.by = Duration::fromSeconds(seconds);
      jumps.push_back(jump);
    }
    const ScratchFolder folder("stamps_random");
    checkBack(folder, replayed(folder, jumps));
  }
}

}  // namespace swiftlet
