// The program with a trap on its threads: what each of them allocated, locked, waited for and faulted in, and
// whether those that must not did not. Used as swiftlet; for tests in the kernel sandbox.
// SWIFTLET_TRAP_REOPENS="THREAD...": their cameras go or stall, and return. A camera's buffers are its
// node's, so that a node that is opened again has them mapped anew: the page faults of these threads are
// printed and not judged. Exit code: the program's own, or 3 where a thread did what it must not.

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "firmware_host/commands/program.hpp"
#include "tests/logs/flight_trap.hpp"

namespace swiftlet {
namespace {

/// From their first turn to their end: no heap call, no lock. They wait for the kernel for their devices
/// alone.
constexpr std::array<std::string_view, 4> kSensorThreads = {"imu", "camera0", "camera1", "trigger"};
/// Nor do these wait for anybody but the one before them.
constexpr std::array<std::string_view, 4> kStageThreads = {"propagate", "track", "smooth", "mesh"};
/// Followers with a real-time priority: as sensors, but for faults, since they begin before memory is locked.
constexpr std::array<std::string_view, 1> kFollowersHeld = {"autopilot"};
// All others run below the flight path (loop, map, log, record, dds with its library, view, decoders): their
// counts are printed and not judged.

template <typename List>
bool isIn(const List& list, std::string_view name) {
  return std::ranges::find(list, name) != list.end();
}

bool keepsTheRules(const TrappedThread& thread) {
  const bool stage = isIn(kStageThreads, thread.name);
  const bool follower = isIn(kFollowersHeld, thread.name);
  if (!stage && !follower && !isIn(kSensorThreads, thread.name)) return true;
  const char* reopens = std::getenv("SWIFTLET_TRAP_REOPENS");
  const bool maps = reopens != nullptr && std::string(reopens).find(thread.name) != std::string::npos;
  const TrapCounts& counts = thread.counts;
  return counts.heap == 0 && counts.locks == 0 && (!stage || counts.waits == 0) &&
         (maps || follower || counts.minor_faults + counts.major_faults == 0);
}

int run(int argc, char** argv) {
  armAllThreads();
  const int code = runProgram(argc, argv);
  std::printf("%-12s%12s%8s%8s%14s%14s\n", "thread", "heap calls", "locks", "waits", "minor faults",
              "major faults");
  bool kept = true;
  for (const TrappedThread& thread : trappedThreads()) {
    const TrapCounts& c = thread.counts;
    const bool keeps = keepsTheRules(thread);
    kept = kept && keeps;
    std::printf("%-12s%12llu%8llu%8llu%14llu%14llu%s\n", thread.name.c_str(),
                static_cast<unsigned long long>(c.heap), static_cast<unsigned long long>(c.locks),
                static_cast<unsigned long long>(c.waits), static_cast<unsigned long long>(c.minor_faults),
                static_cast<unsigned long long>(c.major_faults), keeps ? "" : "  MUST NOT");
  }
  constexpr int kBroken = 3;
  return kept ? code : kBroken;
}

}  // namespace
}  // namespace swiftlet

int main(int argc, char** argv) { return swiftlet::run(argc, argv); }
