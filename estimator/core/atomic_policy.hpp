#pragma once
// What the carriers between threads (SpscRing, DropOldestRing, SlotPool, Newest, NewestShared) are
// written over: the atomics they use, as a policy, so that the tests can run the very same code on
// modelled atomics.
//
// The carriers use acquire, release and relaxed operations only: no sequentially consistent ones and no
// fences (ThreadSanitizer does not understand fences). They hold no thread, no clock, no lock and no
// waiting; who sleeps until something arrives does so outside (the host's executor).
//
// How they are shown right: tests/core runs small cases in every interleaving and with every stale read
// that release, acquire and relaxed allow, and takes each order and each indivisible step away in turn to
// see that a case fails without it. That model has no load buffering (a load that reads what a later step
// of its own thread made possible); there the argument in the header stands alone, with stress on real
// threads and ThreadSanitizer beside it.

#include <atomic>
#include <cassert>
#include <cstddef>
#include <cstdint>

namespace swiftlet {

/// Bytes that two threads must not share for writing: the cache line of x86-64 and Cortex-A.
/// A constant of our own: std::hardware_destructive_interference_size changes with -mtune, and with it
/// the layout of every type that uses it.
inline constexpr std::size_t kCacheLine = 64;

struct HardwareAtomics {
  template <typename T>
  using Atomic = std::atomic<T>;

  /// A programming error of the caller: assertion in debug builds, nothing in flight.
  static void require([[maybe_unused]] bool condition, [[maybe_unused]] const char* what) {
    assert(condition && what != nullptr);
  }
};
static_assert(std::atomic<std::uint64_t>::is_always_lock_free &&
              std::atomic<std::uint32_t>::is_always_lock_free);

/// A counter of events for summary.json: one thread counts, any thread may look. No protocol depends on
/// its order, so it is not among the modelled atomics.
class EventCount {
 public:
  void add() { value_.store(value() + 1, std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t value() const { return value_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::uint64_t> value_{0};
};

}  // namespace swiftlet
