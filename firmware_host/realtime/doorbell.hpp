#pragma once
// Lets a thread sleep until something arrives: no mutex, no condition variable, bounded waiting, no lost
// wake-up. Bells carry no data: the sleeper looks at its rings and newest values.
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
// Cost: ring is one wait-free fetch_add (one instruction on x86-64 and ARMv8.1), plus one futex call if the
// sleeper has announced itself. wait makes no system call if the bell was rung.
// Memory: one cache line, so that ringing does not disturb neighbouring data.
//
// Why no wake-up is lost: the number of rings and the sleeper's announcement share one 32-bit word, so all
// threads agree on the order of its changes. The sleeper announces itself by a compare-and-exchange from
// "ticket, awake" to "ticket, asleep", which fails if a ring came since the ticket. After it succeeded, a
// ringer's fetch_add sees the announcement and calls the kernel. The kernel, holding its own lock on the
// word, puts the sleeper to sleep only while the word is still "ticket, asleep". So a ring comes before the
// announcement (the exchange fails), between announcement and sleep (the kernel refuses), or after (the
// ringer wakes the sleeper). What was published before a ring is visible after the wait that it ended, or
// after the ticket that counted it: release in ring, acquire in ticket and wait.
// Every ringer that sees the announcement calls the kernel. If the first one cleared the announcement to
// spare the others the call, they would depend on a ringer that may be preempted between clearing and waking:
// a low-priority thread could prolong the sleep of a high-priority one.
// tests/firmware_host runs this header in every interleaving of small cases, with every stale read that the
// memory orders allow, and removes each order and each atomic step in turn to see a case fail. The ring count
// wraps at 2^31: after exactly that many rings since its ticket (24 days at 1 kHz), a sleeper sleeps for its
// full bound.

#include <atomic>
#include <cstdint>

#include "estimator/core/atomic_policy.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// The kernel's part: sleeping and waking by futex.
struct KernelSleep {
  template <typename T>
  using Atomic = std::atomic<T>;

  /// Sleeps while the word is `value`, at most `at_most`. Checking and falling asleep are atomic.
  static void sleepWhile(std::atomic<std::uint32_t>& word, std::uint32_t value, Duration at_most);
  /// Wakes the thread that sleeps on the word.
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

  /// Any thread, and signal handlers.
  void ring() {
    if ((word_.fetch_add(kOneRing, std::memory_order_release) & kAsleep) != 0) Policy::wake(word_);
  }

  /// Sleeper. Sleeps until a ring later than `ticket`, at most `at_most` of CLOCK_MONOTONIC (zero or less:
  /// only checks). True if there was such a ring, whether it ended the sleep or not; false if time ran out.
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
    // Only this thread withdraws the announcement, so any other difference is a ring.
    return word_.fetch_and(~kAsleep, std::memory_order_acquire) != (awake | kAsleep);
  }

 private:
  static constexpr std::uint32_t kAsleep = 1;   ///< lowest bit: the sleeper is asleep or about to be
  static constexpr std::uint32_t kOneRing = 2;  ///< the other 31 bits count rings

  typename Policy::template Atomic<std::uint32_t> word_{0};
};

using Doorbell = BasicDoorbell<KernelSleep>;

}  // namespace swiftlet
