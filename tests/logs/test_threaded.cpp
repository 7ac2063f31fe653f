// Runs on threads: they lose nothing at the log's own speed and agree with lockstep; overloaded they
// degrade by policy, account for every message, and are repeated byte for byte from their recordings; a
// killed recording keeps all but its last second.

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "drivers/recorded/open_log.hpp"
#include "drivers/recorded/recording_source.hpp"
#include "estimator/core/random.hpp"
#include "firmware_host/inputs/log/log_player.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "firmware_host/schedule/threaded.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/sanitized.hpp"
#include "tests/support/long_run.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

using test::textOf;

/// Sanitizers slow everything down tenfold: a second of the log then, at a fifth of its speed, and nothing
/// said about losses, which they cause.
constexpr double kSlow = kSanitized ? 0.2 : 1;

/// Of random overloads, and of kills.
int chosenRuns() { return longOr(20, 4); }

/// Of the short log.
constexpr std::uint64_t kImages = kSanitized ? 42 : 160;  // of both cameras
constexpr Stamp kLastImage{kSanitized ? 1'403'636'585'763'555'584 : 1'403'636'588'713'555'456};

/// The same names with the same bytes, and at least one.
bool sameFiles(const std::string& one, const std::string& other) {
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(one)) {
    if (textOf(entry.path().string()) != textOf(other + "/" + entry.path().filename().string())) return false;
    ++files;
  }
  const auto others = std::distance(std::filesystem::directory_iterator(other), {});
  return files > 0 && files == static_cast<std::size_t>(others);
}

ReplayRequest requestFor(const std::string& log, const std::string& out) {
  ReplayRequest request;
  request.accuracy = runAccuracyJson;
  request.log = log;
  request.out = out;
  request.imu_rate = true;
  request.speed = kSlow;
  if (kSanitized) request.until = 1;
  return request;
}

double ateOf(const ReplayResult& result) {
  return result.summary["accuracy"]["odometry"]["all"]["se3"]["ate_m"]["rmse"].get<double>();
}

/// Everything that went in came out, or was counted where it went.
void checkAccounts(const RunStatistics& s, std::uint64_t images_in_log) {
  std::uint64_t lost = 0;
  std::uint64_t dropped = 0;
  for (const auto& [arrow, count] : s.losses) {
    if (arrow.starts_with("camera_") && arrow.ends_with("_lost")) lost += count;
    if (arrow.starts_with("camera_") && arrow.ends_with("_dropped")) dropped += count;
  }
  CHECK(s.images + lost == images_in_log);
  const PairingCounters& p = s.pairing;
  CHECK(2 * p.pairs + p.unpaired[0] + p.unpaired[1] + p.refused[0] + p.refused[1] == s.images - dropped);
  CHECK(s.frames + s.frames_dropped == p.pairs + p.unpaired[0] + p.unpaired[1]);
}

TEST_CASE("at the log's own speed threads lose nothing and agree with lockstep") {
  const ScratchFolder folder("threaded");
  const ReplayResult lockstep = runReplay(requestFor(shortLog(), folder.file("lockstep")), Settings{});
  ReplayRequest request = requestFor(shortLog(), folder.file("threaded"));
  request.real_time = true;
  const ReplayResult threaded = runReplay(request, Settings{});
  REQUIRE(threaded.finished);
  checkAccounts(threaded.statistics, kImages);
  if (kSanitized) return;
  CHECK(threaded.statistics.losses.empty());
  CHECK(threaded.statistics.frames_dropped == 0);
  CHECK(threaded.statistics.frames == lockstep.statistics.frames);
  CHECK(threaded.statistics.imu_samples == lockstep.statistics.imu_samples);
  CHECK(threaded.statistics.poses == lockstep.statistics.poses);
  // Ten per cent or two millimetres, whichever is more.
  CHECK(std::abs(ateOf(threaded) - ateOf(lockstep)) < std::max(0.1 * ateOf(lockstep), 0.002));
}

TEST_CASE("a recording replayed in lockstep gives the bytes of the run that it was made of") {
  const ScratchFolder folder("recorded");
  ReplayRequest request = requestFor(shortLog(), folder.file("run"));
  request.record = true;
  REQUIRE(runReplay(request, Settings{}).finished);
  REQUIRE(runReplay(requestFor(folder.file("run"), folder.file("again")), Settings{}).finished);
  for (const char* file :
       {"odometry.tum", "states.csv", "imu_rate.tum", "map.tum", "events.log", "local_mesh.ply"}) {
    CHECK(textOf(folder.file("run/") + file) == textOf(folder.file("again/") + file));
  }
}

/// Makes stages up to four times as slow for random stretches of frames; the last third of a run is free.
class RandomDrag {
 public:
  /// A frame and a half: at three times the log's speed one comes every 17 ms.
  static constexpr double kTooLong = 0.025 / kSlow;  // s

  explicit RandomDrag(std::uint64_t seed) : random_(seed + 1) {
    constexpr int kStretches = 4;
    for (int i = 0; i < kStretches; ++i) {
      const int begin = static_cast<int>(random_.below(40));
      stretches_.push_back({random_.below(2) == 0 ? StageId::kTrack : StageId::kSmooth, begin,
                            begin + 4 + static_cast<int>(random_.below(20)), random_.uniform(2.0, 4.0), 0});
    }
    // One of them is sure to be too much, however fast the machine.
    stretches_.push_back({StageId::kTrack, 8, 40, 4.0, kTooLong});
  }

  void operator()(StageId stage, double cpu) {
    if (stage != StageId::kTrack && stage != StageId::kSmooth) return;  // each counts on a thread of its own
    const int frame = (stage == StageId::kTrack ? tracked_ : smoothed_)++;
    double more = 0;
    for (const Stretch& s : stretches_) {
      if (s.stage != stage || frame < s.begin || frame >= s.end) continue;
      more = std::max({more, (s.factor - 1) * cpu, s.least});
    }
    const double until = threadCpuSeconds() + more;
    while (threadCpuSeconds() < until) {
    }
  }

 private:
  struct Stretch {
    StageId stage;
    int begin, end;  // frames of that stage
    double factor;
    double least;  // s, on top of the stage's own
  };
  Random random_;
  std::vector<Stretch> stretches_;
  int tracked_ = 0;   // of the thread `track`
  int smoothed_ = 0;  // of the thread `smooth`
};

TEST_CASE("overloaded, threads degrade by policy, recover, and are repeated byte for byte", "[long]") {
  const int runs = kSanitized ? 2 : chosenRuns();
  // A frame every 17 ms for stages that take 7 to 12, and up to 48 where they are dragged.
  constexpr double kSpeed = 3;
  std::uint64_t dropped = 0;
  std::uint64_t effort_changes = 0;
  int complete = 0;
  for (int run = 0; run < runs; ++run) {
    CAPTURE(run);
    const ScratchFolder folder("overload");
    ReplayRequest request = requestFor(shortLog(), folder.file("run"));
    request.real_time = true;
    request.speed = kSpeed * kSlow;
    request.record = true;
    request.mesh_sequence = true;
    request.loop_closure = !kSanitized;  // its images take minutes under a sanitizer, the map's too
    request.map = !kSanitized;
    RandomDrag drag(static_cast<std::uint32_t>(run));
    ReplayHooks hooks;
    hooks.drag = [&](StageId stage, double cpu) { drag(stage, cpu); };
    const ReplayResult result = runReplay(request, Settings{}, hooks);
    REQUIRE(result.finished);
    checkAccounts(result.statistics, kImages);
    CHECK(result.statistics.first_pose.has_value());
    // It is back at the end: the log's last image has its pose, and the estimate never started anew.
    CHECK(result.statistics.last_image == kLastImage);
    CHECK(result.statistics.health.back().epoch == 0);
    if (!kSanitized) CHECK(ateOf(result) < 0.05);
    dropped += result.statistics.frames_dropped;
    effort_changes += result.statistics.effort_changes;

    ReplayRequest again = requestFor(folder.file("run"), folder.file("again"));
    again.mesh_sequence = true;
    again.reproduce = true;
    // A disk that stands still for most of a second costs records; such a run is refused, with the place.
    if (openRecording(folder.file("run"))->firstLoss()) {
      CHECK_THROWS_AS(runReplay(again, Settings{}), InputError);
      continue;
    }
    const ReplayResult repeated = runReplay(again, Settings{});
    CHECK(repeated.finished);
    ++complete;
    CHECK(result.statistics.loop.has_value() == request.loop_closure);
    if (request.loop_closure && repeated.statistics.loop) {
      CHECK(repeated.statistics.loop->keyframes == result.statistics.loop->keyframes);
      CHECK(repeated.statistics.loop->nodes == result.statistics.loop->nodes);
      CHECK(repeated.statistics.loop->without_image == result.statistics.loop->without_image);
    }
    CHECK(result.statistics.mapping.has_value() == request.map);
    for (const char* file :
         {"odometry.tum", "states.csv", "map.tum", "local_mesh.ply", "loops.csv", "map.ply", "map.glb"}) {
      CAPTURE(file);
      CHECK(textOf(folder.file("run/") + file) == textOf(folder.file("again/") + file));
    }
    if (!result.statistics.losses.contains("meshes_to_log")) {
      CHECK(sameFiles(folder.file("run/meshes"), folder.file("again/meshes")));
    }
    if (!result.statistics.losses.contains("states_to_log")) {
      CHECK(textOf(folder.file("run/imu_rate.tum")) == textOf(folder.file("again/imu_rate.tum")));
    }
  }
  WARN(runs << " overloaded runs: " << dropped << " frames dropped, " << effort_changes
            << " changes of effort, " << complete << " complete recordings");
  CHECK(dropped + effort_changes > 0);
  CHECK(4 * complete >= 3 * runs);
}

TEST_CASE("a stage that stands still loses the oldest images, counted, and goes on") {
  const ScratchFolder folder("stall");
  ReplayRequest request = requestFor(shortLog(), folder.file("run"));
  request.real_time = true;
  request.record = true;
  ReplayHooks hooks;
  constexpr int kStalled = kSanitized ? 3 : 20;  // early enough for 16 frames to follow
  // 16 frames long: more than the camera rings and the waiting frames hold; and shorter than the 3 s after
  // which a flight thread counts as lost.
  constexpr double kSpeed = kSanitized ? 0.5 : 1;
  constexpr double kStall = 0.8 / kSpeed;  // s
  request.speed = kSpeed;
  int frame = 0;
  hooks.drag = [&](StageId stage, double /*cpu*/) {
    if (stage == StageId::kTrack && ++frame == kStalled) usleep(static_cast<useconds_t>(1e6 * kStall));
  };
  const ReplayResult result = runReplay(request, Settings{}, hooks);
  REQUIRE(result.finished);
  checkAccounts(result.statistics, kImages);
  CHECK(result.statistics.losses.contains("camera_0_dropped"));
  CHECK(result.statistics.losses.contains("camera_1_dropped"));
  CHECK(result.statistics.last_image == kLastImage);
  CHECK(result.statistics.health.back().epoch == 0);
  ReplayRequest again = requestFor(folder.file("run"), folder.file("again"));
  again.reproduce = true;
  REQUIRE(runReplay(again, Settings{}).finished);
  for (const char* file : {"odometry.tum", "states.csv", "map.tum"}) {
    CHECK(textOf(folder.file("run/") + file) == textOf(folder.file("again/") + file));
  }
}

/// On threads, every step of a stage held up by so many seconds of the log.
ReplayResult runHeldUp(ReplayRequest request, StageId held_up, double seconds) {
  request.real_time = true;
  ReplayHooks hooks;
  hooks.drag = [&](StageId stage, double /*cpu*/) {
    if (stage == held_up) usleep(static_cast<useconds_t>(1e6 * seconds / kSlow));
  };
  ReplayResult result = runReplay(request, Settings{}, hooks);
  REQUIRE(result.finished);
  checkAccounts(result.statistics, kImages);
  return result;
}

TEST_CASE("a mesh that falls behind skips to the newest window, and nobody waits for it") {
  const ScratchFolder folder("mesh_behind");
  ReplayRequest request = requestFor(shortLog(), folder.file("run"));
  request.record = true;
  const ReplayResult result = runHeldUp(request, StageId::kMesh, 0.18);  // some four frames
  CHECK(result.statistics.last_image == kLastImage);
  REQUIRE(result.statistics.mesh);
  const MeshStatistics& mesh = *result.statistics.mesh;
  CHECK(mesh.skipped > mesh.stage.frames);
  CHECK(mesh.skipped + mesh.stage.frames + mesh.stage.invalid_frames <= result.statistics.frames);
  if (!kSanitized) CHECK(result.statistics.frames_dropped == 0);
  ReplayRequest again = requestFor(folder.file("run"), folder.file("again"));
  again.reproduce = true;
  const ReplayResult repeated = runReplay(again, Settings{});
  REQUIRE(repeated.finished);
  REQUIRE(repeated.statistics.mesh);
  CHECK(repeated.statistics.mesh->stage.frames == mesh.stage.frames);
  CHECK(repeated.statistics.mesh->without_image == mesh.without_image);
  CHECK_FALSE(textOf(folder.file("run/local_mesh.ply")).empty());
  for (const char* file : {"odometry.tum", "local_mesh.ply"}) {
    CHECK(textOf(folder.file("run/") + file) == textOf(folder.file("again/") + file));
  }
}

/// Fails as a full disk would.
class FailingListener : public RunListener {
 public:
  void onFrame(const TrackedFrame& /*tracked*/, const OdometryOutput& /*output*/) override {
    if (++frames_ == 10) throw std::runtime_error("the disk is full");
  }
  void onImuState(const NavState& /*state*/) override {}
  void onFinish(const OdometryOutput& /*output*/) override {}
  void onRemark(Stamp /*stamp*/, const std::string& /*text*/) override {}

 private:
  int frames_ = 0;
};

TEST_CASE("two runs with loop closure and a map write the same map") {
  const ScratchFolder folder("mapped");
  for (const char* run : {"one", "two"}) {
    ReplayRequest request = requestFor(shortLog(), folder.file(run));
    request.loop_closure = true;
    request.map = true;
    const ReplayResult result = runReplay(request, Settings{});
    REQUIRE(result.finished);
    CHECK(result.statistics.losses.empty());
    REQUIRE(result.statistics.mapping);
    // Of all keyframes those with a pose that was not still being found.
    CHECK(2 * result.statistics.mapping->frames >= result.statistics.keyframes);
    CHECK(result.statistics.mapping->refused == 0);
    // Of four seconds, or of one.
    CHECK(result.summary["map"]["mesh"]["faces"].get<int>() > (kSanitized ? 300 : 1000));
  }
  for (const char* file : {"map.ply", "map.glb", "odometry.tum"}) {
    CHECK(textOf(folder.file("one/") + file) == textOf(folder.file("two/") + file));
  }
}

TEST_CASE("a map that falls behind misses frames, counted, and nobody waits for it") {
  const ScratchFolder folder("slow_map");
  ReplayRequest request = requestFor(shortLog(), folder.file("run"));
  request.map = true;
  const ReplayResult result = runHeldUp(request, StageId::kDepth, 0.6);
  REQUIRE(result.statistics.mapping);
  const MapThreadStatistics& map = *result.statistics.mapping;
  CHECK(map.frames > 0);
  const auto& losses = result.statistics.losses;
  const auto lost = [&](const char* name) { return losses.contains(name) ? losses.at(name) : 0U; };
  CHECK(lost("frames_unmapped") == map.without_image + map.without_scene);
  CHECK(result.summary["map"]["taken"].get<std::uint64_t>() + map.without_image + map.refused == map.frames);
  if (kSanitized) return;
  CHECK(map.without_image + lost("frame_images_to_map") > 0);
  CHECK(result.statistics.frames_dropped == 0);
}

TEST_CASE("a log that fails ends neither the flight nor the waiting for its end") {
  const auto source = openLog(shortLog());
  FailingListener listener;
  RunObserver observer(listener);
  LogFeed feed(*source, {}, nullptr);
  const Settings settings;
  const auto graph =
      std::make_unique<Graph>(source->rig(), source->imuNoise(), settings, observer, GraphOptions{});
  LogPlayer player(feed, kSlow);
  const ThreadedReport report = runThreaded(player, *graph, ThreadedOptions{}, RunControl{});
  REQUIRE(report.faults.size() == 1);
  CHECK(report.faults[0] == "log: the disk is full");
  CHECK(graph->smooth().done());
  CHECK(graph->sensors().counters().images[0] == 80);
}

// Sanitizers do not follow threads after a fork.
TEST_CASE("a killed recording loses at most its last second", "[unsanitized][long]") {
  const int runs = chosenRuns();
  constexpr std::uint64_t kFramesPerSecond = 20;
  Random random(11);
  void* shared = mmap(nullptr, sizeof(std::atomic<std::uint64_t>), PROT_READ | PROT_WRITE,
                      MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  REQUIRE(shared != MAP_FAILED);
  auto& tracked = *new (shared) std::atomic<std::uint64_t>(0);
  for (int run = 0; run < runs; ++run) {
    CAPTURE(run);
    const ScratchFolder folder("killed");
    tracked.store(0);
    const pid_t child = fork();
    REQUIRE(child >= 0);
    if (child == 0) {
      ReplayRequest request = requestFor(shortLog(), folder.file("run"));
      request.real_time = true;
      request.record = true;
      ReplayHooks hooks;
      hooks.drag = [&](StageId stage, double /*cpu*/) {
        if (stage == StageId::kTrack) tracked.fetch_add(1);
      };
      try {
        runReplay(request, Settings{}, hooks);
      } catch (...) {
      }
      _exit(0);
    }
    const std::uint64_t until = 5 + random.below(65);
    for (int waited = 0; tracked.load() < until && waited < 20'000; ++waited) usleep(1000);
    usleep(static_cast<useconds_t>(random.below(50'000)));
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    const std::uint64_t done = tracked.load();
    const auto recording = openRecording(folder.file("run"));
    CHECK(recording->steps().track.size() + kFramesPerSecond >= done);
    CHECK(recording->lastImage(0) + kFramesPerSecond >= done);
    if (recording->lastImage(0) == 0) continue;
    const std::uint64_t frames = recording->lastImage(0);
    ReplayRequest again = requestFor(folder.file("run"), folder.file("again"));
    const ReplayResult result = runReplay(again, Settings{});
    CHECK(result.finished);
    CHECK(result.statistics.frames >= frames - 1);
  }
  munmap(shared, sizeof(std::atomic<std::uint64_t>));
}

}  // namespace
}  // namespace swiftlet
