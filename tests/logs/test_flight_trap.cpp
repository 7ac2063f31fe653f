// No heap call, no lock and no call that waits for others on the flight path, over a whole run on threads,
// seen from underneath the program and its libraries.

#include <poll.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdlib>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "firmware_host/realtime/flight_thread.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/flight_trap.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/skip_case.hpp"
#include "tests/support/view_client.hpp"

namespace swiftlet {
namespace {

/// SWIFTLET_TRAP_LOG names a log of SWIFTLET_DATA to use instead of the repository's own seconds.
std::string chosenLog() {
  const char* name = std::getenv("SWIFTLET_TRAP_LOG");
  if (name != nullptr) {
    if (const auto log = findLog(name)) return *log;
  }
  return shortLog();
}

/// Held to nothing at all from their first message to their end.
constexpr std::array kFlightThreads = {"sensor", "propagate", "track", "smooth", "mesh"};

nlohmann::ordered_json checkRun(bool mono, bool record, bool planes = false, bool loops = false,
                                bool map = false, const std::optional<ViewAddress>& view = {}) {
  const ScratchFolder folder("flight_trap");
  ReplayRequest request;
  request.log = chosenLog();
  request.out = folder.file("run");
  request.mono = mono;
  request.real_time = true;
  request.imu_rate = true;
  request.mesh_sequence = true;
  request.record = record;
  request.loop_closure = loops;
  request.map = map;
  request.view = view;
  resetTrap();
  armAllThreads();
  const std::uint64_t all_before = heapCallsOfAll();
  Settings settings;
  settings.odometry.regularity_enabled = planes;
  const ReplayResult result = runReplay(request, settings);
  FlightThread::watchAll(nullptr);
  REQUIRE(result.finished);
  REQUIRE(result.statistics.mesh);
  CHECK(result.statistics.mesh->stage.frames > 0);
  CHECK(result.statistics.poses > 0);
  CHECK(heapCallsOfAll() > all_before + 1000);  // the other threads do, and are seen
  const auto& executor = result.summary["executor"];
  const bool locked = executor["memory_lock"]["current"] && executor["memory_lock"]["future"];
  if (!locked) {
    skipCase("page faults are not checked: " + executor["memory_lock"]["message"].get<std::string>(),
             "sudo toolchain/test.sh");
  }
  for (const char* name : kFlightThreads) {
    INFO(name);
    const auto threads = trappedThreads();
    CHECK(std::ranges::count(threads, name, &TrappedThread::name) == 1);
    const TrapCounts counts = trapCountsOf(name);
    CHECK(counts.heap == 0);
    CHECK(counts.locks == 0);
    CHECK(counts.waits == 0);
    const auto& reports = executor["threads"];
    const auto report = std::ranges::find_if(reports, [&](const auto& one) { return one["name"] == name; });
    REQUIRE(report != reports.end());
    if (!locked) continue;
    CHECK((*report)["page_faults"]["minor"] == 0);
    CHECK((*report)["page_faults"]["major"] == 0);
  }
  return result.summary;
}

TEST_CASE("the trap sees heap calls, locks and waits of an armed thread") {
  resetTrap();
  armTrap("a thread");
  {
    const std::string long_enough(1000, 'x');
    std::mutex mutex;
    const std::lock_guard lock(mutex);
    static_cast<void>(long_enough);
    pollfd nothing{-1, 0, 0};
    static_cast<void>(::poll(&nothing, 1, 0));
    // Two pages that nobody has touched.
    constexpr std::size_t kBytes = 8192;
    void* const pages = mmap(nullptr, kBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    static_cast<volatile char*>(pages)[0] = 1;
    static_cast<volatile char*>(pages)[kBytes - 1] = 1;
    munmap(pages, kBytes);
  }
  disarmTrap();
  CHECK(trapCounts().heap == 2);  // taken and given back
  CHECK(trapCounts().locks == 1);
  CHECK(trapCounts().waits == 1);
  CHECK(trapCountsOf("a thread").heap == 2);
  CHECK(trapCountsOf("a thread").minor_faults >= 1);
}

TEST_CASE("the flight path neither allocates nor locks") { checkRun(false, false); }
TEST_CASE("the flight path neither allocates nor locks with one camera") { checkRun(true, false); }

// All of it at once is below, and in the plain set; one by one they tell which it is.
TEST_CASE("the flight path neither allocates nor locks while it is recorded", "[.][long]") {
  checkRun(false, true);
}
TEST_CASE("the flight path neither allocates nor locks with planes and loop closure", "[.][long]") {
  checkRun(false, false, true, true);
}
TEST_CASE("the flight path neither allocates nor locks with loop closure and a map", "[.][long]") {
  checkRun(false, true, false, true, true);
}

#ifdef SWIFTLET_LIVE_VIEW
TEST_CASE(
    "recorded, with planes, loop closure, a map and viewers the flight path neither allocates nor locks nor "
    "waits") {
  ViewAddress address;
  address.port = freePort();
  // One that reads, and three that take no byte of what they asked for.
  std::atomic<bool> stop{false};
  std::string stream;
  std::thread viewers([&] {
    std::vector<ViewClient> slow;
    for (int i = 0; i < 3; ++i) slow.emplace_back(address.port, true);
    for (ViewClient& one : slow) {
      while (!stop && !one.connectAndAsk("/stream"))
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    ViewClient reader(address.port);
    while (!stop && !reader.connectAndAsk("/stream"))
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    while (!stop && reader.readSome(0.1)) {
    }
    stream = reader.text();
  });
  const nlohmann::ordered_json summary = checkRun(false, true, true, true, true, address);
  stop = true;
  viewers.join();
  CHECK(summary["executor"]["view"]["viewers"] == 4);
  CHECK(summary["executor"]["view"]["delivered"] > 10);
  CHECK(summary["executor"]["view"]["images_delivered"] > 10);
  CHECK(stream.find("event: patch") != std::string::npos);
  CHECK(stream.find("event: images") != std::string::npos);
  CHECK(stream.find("event: end") != std::string::npos);
}
#else
TEST_CASE("recorded, with planes, loop closure and a map the flight path neither allocates nor locks") {
  checkRun(false, true, true, true, true);
}
#endif

}  // namespace
}  // namespace swiftlet
