#pragma once
// Counts what the flight path must not do, underneath everything: heap calls, calls that take or wait for a
// lock, and calls of the kernel that may wait for a file, a socket or another program, on the threads that
// armed the trap. Link flight_trap.cpp into the program: it stands in for malloc, for the pthread functions
// and for those of the C library. Not with sanitizers, which do the same.

#include <cstdint>

namespace swiftlet {

struct TrapCounts {
  std::uint64_t heap = 0;
  std::uint64_t locks = 0;
  std::uint64_t waits = 0;
};

/// For the calling thread.
void armTrap();
void disarmTrap();
/// Calls by armed threads so far.
TrapCounts trapCounts();
/// Heap calls by all threads, armed or not: shows that the trap works.
std::uint64_t heapCallsOfAll();

}  // namespace swiftlet
