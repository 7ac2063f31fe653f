#include "firmware_host/realtime/doorbell.hpp"

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <ctime>

namespace swiftlet {
namespace {

static_assert(sizeof(std::atomic<std::uint32_t>) == sizeof(std::uint32_t) &&
                  std::atomic<std::uint32_t>::is_always_lock_free,
              "the kernel reads the atomic as a plain word");
static_assert(sizeof(timespec{}.tv_sec) == sizeof(long), "SYS_futex takes the kernel's own timespec");

constexpr long kNanosPerSecond = 1'000'000'000;

/// The clock's reading after `duration`.
timespec deadlineAfter(Duration duration) {
  timespec deadline{};
  clock_gettime(CLOCK_MONOTONIC, &deadline);
  deadline.tv_sec += duration.ns / kNanosPerSecond;
  deadline.tv_nsec += duration.ns % kNanosPerSecond;
  if (deadline.tv_nsec >= kNanosPerSecond) {
    deadline.tv_nsec -= kNanosPerSecond;
    ++deadline.tv_sec;
  }
  return deadline;
}

bool isPast(const timespec& deadline) {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec > deadline.tv_sec || (now.tv_sec == deadline.tv_sec && now.tv_nsec >= deadline.tv_nsec);
}

/// Sleeps while the word is `value`, until the deadline (absolute, CLOCK_MONOTONIC), or for no reason.
void futexWait(std::atomic<std::uint32_t>& word, std::uint32_t value, const timespec& deadline) {
  syscall(SYS_futex, &word, FUTEX_WAIT_BITSET_PRIVATE, value, &deadline, nullptr, FUTEX_BITSET_MATCH_ANY);
}

}  // namespace

void Doorbell::wake() {
  // One sleeper: one to wake. Not INT_MAX, so that a second one shows as a fault in the tests.
  syscall(SYS_futex, &word_, FUTEX_WAKE_PRIVATE, 1, nullptr, nullptr, 0);
}

bool Doorbell::wait(std::uint32_t ticket, Duration at_most) {
  const std::uint32_t awake = ticket << 1U;
  if (word_.load(std::memory_order_acquire) != awake) return true;
  if (at_most.ns <= 0) return false;
  const timespec deadline = deadlineAfter(at_most);
  std::uint32_t expected = awake;
  if (!word_.compare_exchange_strong(expected, awake | kAsleep, std::memory_order_acq_rel,
                                     std::memory_order_acquire)) {
    return true;
  }
  // A signal or a late wake of an earlier round may end a sleep early.
  while (word_.load(std::memory_order_acquire) == (awake | kAsleep) && !isPast(deadline)) {
    futexWait(word_, awake | kAsleep, deadline);
  }
  // Only this thread takes the announcement back, so what is left is the number of rings.
  return word_.fetch_and(~kAsleep, std::memory_order_acq_rel) != (awake | kAsleep);
}

}  // namespace swiftlet
