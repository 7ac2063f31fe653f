// A thread of a threaded run throws, returns early, or stands still: what is said, after how long, what goes
// on, and how the run ends. Prints a table of it. In the long set (tests/support/long_run.hpp):
// every node and follower; else one of each kind.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/device/monotonic_now.hpp"
#include "firmware_host/interfaces/follower_thread.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/long_run.hpp"
#include "tests/support/text.hpp"
#include "tests/support/view_client.hpp"

namespace swiftlet {
namespace {

using test::textOf;

enum class Fault : std::uint8_t { kThrows, kReturns, kStalls, kStuck };

const char* nameOf(Fault fault) {
  constexpr std::array kNames{"throws", "returns early", "stalls 2 s", "stuck"};
  return kNames[static_cast<std::size_t>(fault)];
}

/// What happens to one thread, and what the verdicts say of it. Of one run at a time.
struct Scene {
  std::string_view thread;
  Fault fault = Fault::kThrows;

  std::atomic<std::int64_t> first_turn{0};
  std::atomic<std::int64_t> struck{0};     ///< CLOCK_MONOTONIC of the fault
  std::atomic<std::int64_t> told{0};       ///< first verdict that names the thread
  std::atomic<std::int64_t> lost{0};       ///< first that calls it lost
  std::atomic<std::int64_t> recovered{0};  ///< first after told that does not name it
  std::atomic<std::int64_t> failed{0};     ///< first that ends the run
  std::atomic<Health> worst{Health::kGood};
  std::atomic<bool> released{false};

  /// Of the thread, at each turn; false: return early.
  bool turn(std::string_view name) {
    if (name != thread || struck.load() != 0) return true;
    const std::int64_t now = monotonicNow().ns;
    std::int64_t none = 0;
    first_turn.compare_exchange_strong(none, now);
    // Once the estimate has begun: a second of the log.
    if (now - first_turn.load() < 1'000'000'000) return true;
    struck.store(now);
    if (fault == Fault::kThrows) throw std::runtime_error("made to fail");
    if (fault == Fault::kReturns) return false;
    const double seconds = fault == Fault::kStalls ? 2 : 60;
    while (!released && (monotonicNow() - Stamp{now}).seconds() < seconds)
      sleepFor(Duration::fromMilliseconds(10));
    return true;
  }

  void see(const Verdict& verdict) {
    if (struck.load() == 0) return;
    const Trouble* found = nullptr;
    for (const Trouble& trouble : verdict.troubles) {
      if (trouble.name() == thread && trouble.cause != Cause::kNoProduct) found = &trouble;
    }
    const auto note = [&](std::atomic<std::int64_t>& at) {
      std::int64_t none = 0;
      at.compare_exchange_strong(none, verdict.evaluated.ns);
    };
    if (found != nullptr) note(told);
    if (found != nullptr && found->condition == Condition::kLost) note(lost);
    if (found == nullptr && told.load() != 0) note(recovered);
    if (verdict.run_failed) note(failed);
    worst.store(worse(worst.load(), verdict.health));
  }

  [[nodiscard]] double after(const std::atomic<std::int64_t>& at) const {
    return at.load() == 0 ? -1 : static_cast<double>(at.load() - struck.load()) * 1e-9;
  }
};

Scene* scene_of_all = nullptr;

struct Outcome {
  ReplayResult result;
  double ended = 0;  ///< s after the fault
  bool logged = false;
};

Outcome fly(Scene& scene, const ScratchFolder& folder) {
  ReplayRequest request;
  request.log = shortLog();
  request.out = folder.file("run");
  request.real_time = true;
  request.record = true;
  request.loop_closure = true;
  request.map = true;
  Settings settings;
  settings.full_smoothing = false;
  if (scene.thread == "view") {
    ViewAddress address;
    address.port = freePort();
    request.view = address;
  }
  if (scene.thread == "autopilot") settings.autopilot.device = "udp:127.0.0.1:14550";
  if (scene.thread == "dds") settings.ros2.enabled = true;
  ReplayHooks hooks;
  hooks.before_turn = [&scene](const char* node) { return scene.turn(node); };
  hooks.verdict = [&scene](const Verdict& verdict) { scene.see(verdict); };
  scene_of_all = &scene;
  FollowerThread::watchTurns([](const char* thread) { return scene_of_all->turn(thread); });
  Outcome outcome;
  outcome.result = runReplay(request, settings, hooks);
  FollowerThread::watchTurns(nullptr);
  outcome.ended = static_cast<double>(monotonicNow().ns - scene.struck.load()) * 1e-9;
  outcome.logged =
      textOf(folder.file("run/events.log")).find(std::string(scene.thread) + " is ") != std::string::npos;
  return outcome;
}

bool isFlightNode(std::string_view thread) {
  return thread == "propagate" || thread == "track" || thread == "smooth";
}

/// From a fault to the first verdict that names it: the longest silence (docs/pipeline.md) and half a second.
double longestSilence(std::string_view thread, Fault fault) {
  if (fault == Fault::kThrows || fault == Fault::kReturns) return 0;
  if (isFlightNode(thread)) return 0.3;
  return thread == "log" || thread == "record" ? 1.5 : 1.0;
}

void check(std::string_view thread, Fault fault) {
  CAPTURE(thread, nameOf(fault));
  const ScratchFolder folder("faults");
  // Left behind with the thread that is stuck, but still known: no leak.
  static auto& scenes = *new std::vector<Scene*>;
  auto* scene = scenes.emplace_back(new Scene);
  scene->thread = thread;
  scene->fault = fault;
  const Outcome outcome = fly(*scene, folder);
  REQUIRE(scene->struck.load() != 0);
  const bool ends = isFlightNode(thread) && fault != Fault::kStalls;
  const bool stuck = fault == Fault::kStuck;

  const double told = scene->after(scene->told);
  CHECK(told >= 0);
  CHECK(told < longestSilence(thread, fault) + 0.5);
  if (fault == Fault::kStalls) {
    CHECK(scene->after(scene->recovered) > 0);
    CHECK(scene->after(scene->lost) < 0);
    CHECK(outcome.result.finished);
  } else {
    CHECK(scene->after(scene->lost) >= 0);
    CHECK_FALSE(outcome.result.finished);  // exit code 1
  }
  if (ends) {
    CHECK(scene->worst == Health::kFailed);
    CHECK(scene->after(scene->failed) < (stuck ? 3.0 : 0.0) + 0.5);
    // 2 s from there, and what is written after the threads' end.
    CHECK(outcome.ended < scene->after(scene->failed) + 3.5);
  } else {
    CHECK(scene->after(scene->failed) < 0);
    CHECK(scene->worst != Health::kFailed);
    CHECK(worse(scene->worst, Health::kDegraded) == scene->worst);
    // The log's last image has its pose, unless nobody wrote it down.
    if (thread != "log") CHECK(outcome.result.statistics.last_image == Stamp{1'403'636'588'713'555'456});
  }
  CHECK(outcome.result.left_behind == stuck);
  // The one alone: those before and behind it end in order.
  if (stuck) CHECK(outcome.result.summary["executor"]["thread_faults"].size() == 1);
  if (thread != "log" || fault == Fault::kStalls) CHECK(outcome.logged);
  const auto seconds = [](double value) {
    return value < 0 ? std::string("-") : fmt::format("{:.2f}", value);
  };
  fmt::print("| {} | {} | {} | {} | {} | {} | {} | {} |\n", thread, nameOf(fault), seconds(told),
             seconds(scene->after(scene->lost)), seconds(scene->after(scene->recovered)),
             seconds(scene->after(scene->failed)), outcome.logged ? "yes" : "no",
             outcome.result.finished ? 0 : 1);
  scene->released = true;
}

TEST_CASE(
    "a thread that throws, returns early or stands still is named, and the flight does what its loss means") {
  fmt::print(
      "| thread | fault | named after [s] | lost after [s] | recovered after [s] | run ended by it after [s] "
      "| "
      "in events.log | exit code |\n|---|---|---|---|---|---|---|---|\n");
  std::vector<std::string_view> threads{"propagate", "track", "smooth", "mesh", "loop",
                                        "map",       "log",   "record", "view", "autopilot"};
#ifdef SWIFTLET_TEST_DDS
  threads.push_back("dds");
#endif
  if (!longRun()) {
    check("track", Fault::kThrows);
    check("mesh", Fault::kReturns);
    check("smooth", Fault::kStalls);
    check("autopilot", Fault::kThrows);
    check("track", Fault::kStuck);
    return;
  }
  for (const std::string_view thread : threads) {
    for (const Fault fault : {Fault::kThrows, Fault::kReturns, Fault::kStalls}) check(thread, fault);
  }
  check("smooth", Fault::kStuck);
  check("track", Fault::kStuck);
}

TEST_CASE("a flight whose supervisor cannot start ends, and says so") {
  const ScratchFolder folder("unsupervised");
  ReplayRequest request;
  request.log = shortLog();
  request.out = folder.file("run");
  request.real_time = true;
  Settings settings;
  settings.full_smoothing = false;
  // No priority of the kernel's, nor is the supervisor's, which lies between those of `track` and `mesh`.
  settings.realtime.mesh_priority = 1000;
  const ReplayResult result = runReplay(request, settings);
  CHECK_FALSE(result.finished);
  CHECK(result.statistics.frames < 20);  // of 80
  const nlohmann::ordered_json faults = result.summary["executor"]["thread_faults"];
  CHECK(std::ranges::any_of(faults, [](const auto& fault) {
    return fault.template get<std::string>().starts_with("supervisor: priority ");
  }));
}

}  // namespace
}  // namespace swiftlet
