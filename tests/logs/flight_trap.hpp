#pragma once
// Counts what the flight path must not do, underneath everything: heap calls, calls that take or wait for a
// lock, calls of the kernel that may wait for a file, a socket or another program, and page faults, on the
// threads that armed the trap. Link flight_trap.cpp into the program: it stands in for malloc, for the
// pthread functions and for those of the C library. Not with sanitizers, which do the same.
// SWIFTLET_TRAP_ABORTS=THREAD aborts in the first heap call or lock of that thread, for a debugger.

#include <cstdint>
#include <string>
#include <vector>

namespace swiftlet {

struct TrapCounts {
  std::uint64_t heap = 0;
  std::uint64_t locks = 0;
  std::uint64_t waits = 0;
  std::uint64_t minor_faults = 0;  ///< between arming and disarming; likewise
  std::uint64_t major_faults = 0;
};

/// For the calling thread, whose counts go under `name`; at most 32 names.
void armTrap(const char* name);
void disarmTrap();
/// Arms every thread of the program that is a FlightThread, under its own name, from its entry's begin to its
/// end.
void armAllThreads();

/// Calls by armed threads so far.
TrapCounts trapCounts();
struct TrappedThread {
  std::string name;
  TrapCounts counts;
};
/// The same by name, in the order of arming.
std::vector<TrappedThread> trappedThreads();
/// The counts under `name`; none where it was never armed.
TrapCounts trapCountsOf(const std::string& name);
/// From here on all counts begin at zero; while no thread is armed.
void resetTrap();
/// Heap calls by all threads, armed or not: shows that the trap works.
std::uint64_t heapCallsOfAll();

}  // namespace swiftlet
