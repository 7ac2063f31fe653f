#pragma once
// Counts what the flight path must not do, underneath everything: heap calls, and calls that take or wait for
// a lock, on the threads that armed the trap. Link flight_trap.cpp into the program: it stands in for malloc
// and for the pthread functions. Not with sanitizers, which do the same.

#include <cstdint>

namespace swiftlet {

struct TrapCounts {
  std::uint64_t heap = 0;
  std::uint64_t locks = 0;
};

/// For the calling thread.
void armTrap();
void disarmTrap();
/// Calls by armed threads so far.
TrapCounts trapCounts();
/// Heap calls by all threads, armed or not: shows that the trap works.
std::uint64_t heapCallsOfAll();

}  // namespace swiftlet
