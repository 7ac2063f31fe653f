#pragma once
// The atomics of the carriers between threads (SpscRing, DropOldestRing, SlotPool, Newest, NewestShared) as a
// policy, so that tests can run the same code on modelled atomics.
//
// The carriers use only acquire, release and relaxed operations: no sequentially consistent ones, and no
// fences, which ThreadSanitizer does not support. They have no thread, clock, lock or waiting; threads sleep
// in the host's executor.
//
// Verification: tests/core runs small cases in every interleaving and with every stale read that release,
// acquire and relaxed allow. It also weakens each memory order and splits each indivisible step in turn, and
// checks that a case then fails. The model has no load buffering (a load that reads a value made possible by
// a later step of its own thread); for that the argument in each header stands alone, with stress tests on
// real threads and ThreadSanitizer.

#include <atomic>
#include <cassert>
#include <cstddef>
#include <cstdint>

namespace swiftlet {

/// Bytes that two threads must not share for writing: the cache line of x86-64 and Cortex-A.
/// Not std::hardware_destructive_interference_size, which changes with -mtune and would change the layout of
/// every type that uses it.
inline constexpr std::size_t kCacheLine = 64;

struct HardwareAtomics {
  template <typename T>
  using Atomic = std::atomic<T>;

  /// Reports a programming error of the caller: an assertion in debug builds, no effect in flight.
  static void require([[maybe_unused]] bool condition, [[maybe_unused]] const char* what) {
    assert(condition && what != nullptr);
  }
};
static_assert(std::atomic<std::uint64_t>::is_always_lock_free &&
              std::atomic<std::uint32_t>::is_always_lock_free);

/// A counter of events for summary.json: one thread counts, any thread may read. No protocol depends on its
/// order, so it is not among the modelled atomics.
class EventCount {
 public:
  void add() { value_.store(value() + 1, std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t value() const { return value_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::uint64_t> value_{0};
};

}  // namespace swiftlet
