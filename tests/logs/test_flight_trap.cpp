// No heap call and no lock on the flight path, over a whole run on threads, seen from underneath the
// program and its libraries.

#include <catch2/catch.hpp>
#include <cstdlib>
#include <mutex>
#include <string>
#include <string_view>

#include "firmware_host/commands/replay_run.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/flight_trap.hpp"
#include "tests/logs/log_data.hpp"

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

bool isFlightThread(std::string_view name) {
  return name == "sensor" || name == "propagate" || name == "track" || name == "smooth" || name == "mesh";
}

void checkRun(bool mono, bool record, bool planes = false, bool loops = false, bool map = false) {
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
  ReplayHooks hooks;
  int armed = 0;
  std::mutex guard;
  hooks.watch = [&](const char* thread, bool begins) {
    if (!isFlightThread(thread)) return;
    if (!begins) {
      disarmTrap();
      return;
    }
    {
      const std::lock_guard lock(guard);
      ++armed;
    }
    armTrap();
  };
  const TrapCounts before = trapCounts();
  const std::uint64_t all_before = heapCallsOfAll();
  Settings settings;
  settings.odometry.regularity_enabled = planes;
  const ReplayResult result = runReplay(request, settings, hooks);
  REQUIRE(result.finished);
  CHECK(armed == 5);
  REQUIRE(result.statistics.mesh);
  CHECK(result.statistics.mesh->stage.frames > 0);
  CHECK(result.statistics.poses > 0);
  CHECK(heapCallsOfAll() > all_before + 1000);  // the other threads do, and are seen
  CHECK(trapCounts().heap == before.heap);
  CHECK(trapCounts().locks == before.locks);
}

TEST_CASE("the trap sees heap calls and locks of an armed thread") {
  const TrapCounts before = trapCounts();
  armTrap();
  {
    const std::string long_enough(1000, 'x');
    std::mutex mutex;
    const std::lock_guard lock(mutex);
    static_cast<void>(long_enough);
  }
  disarmTrap();
  CHECK(trapCounts().heap == before.heap + 2);  // taken and given back
  CHECK(trapCounts().locks == before.locks + 1);
}

TEST_CASE("the flight path neither allocates nor locks") { checkRun(false, false); }
TEST_CASE("the flight path neither allocates nor locks while it is recorded") { checkRun(false, true); }
TEST_CASE("the flight path neither allocates nor locks with one camera") { checkRun(true, false); }
TEST_CASE("the flight path neither allocates nor locks with planes and loop closure") {
  checkRun(false, false, true, true);
}
TEST_CASE("the flight path neither allocates nor locks with loop closure and a map") {
  checkRun(false, true, false, true, true);
}

}  // namespace
}  // namespace swiftlet
