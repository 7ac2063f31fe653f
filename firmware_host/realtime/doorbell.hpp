#pragma once
// How a thread sleeps until something arrives: no mutex, no condition variable, a bounded wait, no lost
// wake-up. Bells carry no data; what arrived is in the rings and newest values that the sleeper looks at.
//
// Threads: one sleeper calls ticket and wait; any number of ringers call ring.
// The sleeper's round, in this order:
//   for (;;) {
//     const std::uint32_t ticket = bell.ticket();  // 1. before looking
//     takeAllThatWaits();                          // 2. look
//     bell.wait(ticket, at_most);                  // 3. sleep, unless rung since 1
//   }
// A ringer first publishes (ring buffer, newest value), then rings.
//
// Cost: ring is one fetch_add, wait-free (one instruction on x86-64 and ARMv8.1), and one futex call when
//   the sleeper has announced itself; else no system call. wait makes no system call when it was rung.
// Memory: one cache line, so that ringers disturb nothing beside it.
//
// Why no wake-up is lost: the number of rings and the sleeper's announcement are one 32-bit word, so all
// threads agree on one order of its changes. The sleeper announces itself by a compare-and-exchange from
// "ticket, awake" to "ticket, asleep": it fails if a ring came since the ticket. After it succeeded, a
// ringer's fetch_add sees the announcement and calls the kernel; and the kernel, holding its own lock on
// the word, puts the sleeper to sleep only while the word still is "ticket, asleep". So a ring falls before
// the announcement (the exchange fails), between it and the sleep (the kernel refuses), or after (the
// ringer wakes). What was published before a ring is seen after the wait that it ended or the ticket that
// counted it: release in ring, acquire in ticket and wait.
// A ringer that saw the announcement always calls the kernel itself. To let the first one clear it and
// spare the others the call would make them depend on a ringer that may have been preempted between
// clearing and waking: a low-priority thread would prolong a high-priority one's sleep.
// tests/firmware_host runs this header in every interleaving of small cases and with every stale read that
// the orders allow, and takes each order and each indivisible step away in turn to see a case fail.
// Rings wrap at 2^31: a ticket held while exactly that many came (24 days at 1 kHz) would sleep its bound.

#include <atomic>
#include <cstdint>

#include "estimator/core/atomic_policy.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// The kernel's part: sleeping and waking, by futex.
struct KernelSleep {
  template <typename T>
  using Atomic = std::atomic<T>;

  /// Sleeps while the word is `value`, at most `at_most`. The check and the falling asleep are one step.
  static void sleepWhile(std::atomic<std::uint32_t>& word, std::uint32_t value, Duration at_most);
  /// Wakes who sleeps on the word.
  static void wake(std::atomic<std::uint32_t>& word);
};

template <typename Policy>
class alignas(kCacheLine) BasicDoorbell {
 public:
  BasicDoorbell() = default;
  BasicDoorbell(const BasicDoorbell&) = delete;
  BasicDoorbell& operator=(const BasicDoorbell&) = delete;

  /// Sleeper. The number of rings so far.
  [[nodiscard]] std::uint32_t ticket() const { return word_.load(std::memory_order_acquire) >> 1U; }

  /// Any thread, a signal handler too.
  void ring() {
    if ((word_.fetch_add(kOneRing, std::memory_order_release) & kAsleep) != 0) Policy::wake(word_);
  }

  /// Sleeper. Sleeps until a ring later than `ticket`, at most `at_most` of CLOCK_MONOTONIC (nothing or
  /// less: looks only). True when there was such a ring, however it was noticed; false when time ran out.
  bool wait(std::uint32_t ticket, Duration at_most) {
    const std::uint32_t awake = ticket << 1U;
    if (word_.load(std::memory_order_acquire) != awake) return true;
    if (at_most.ns <= 0) return false;
    std::uint32_t expected = awake;
    if (!word_.compare_exchange_strong(expected, awake | kAsleep, std::memory_order_acquire,
                                       std::memory_order_acquire)) {
      return true;
    }
    Policy::sleepWhile(word_, awake | kAsleep, at_most);
    // Only this thread takes the announcement back, so what differs is the number of rings.
    return word_.fetch_and(~kAsleep, std::memory_order_acquire) != (awake | kAsleep);
  }

 private:
  static constexpr std::uint32_t kAsleep = 1;   ///< lowest bit: the sleeper is, or is about to be, asleep
  static constexpr std::uint32_t kOneRing = 2;  ///< the other 31 bits count rings

  typename Policy::template Atomic<std::uint32_t> word_{0};
};

using Doorbell = BasicDoorbell<KernelSleep>;

}  // namespace swiftlet
