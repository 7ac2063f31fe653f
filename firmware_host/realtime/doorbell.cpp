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

/// The clock's reading `duration` from now.
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

/// Sleeps while the word is `value`, until the deadline (absolute, CLOCK_MONOTONIC). May return early.
void futexWait(std::atomic<std::uint32_t>& word, std::uint32_t value, const timespec& deadline) {
  syscall(SYS_futex, &word, FUTEX_WAIT_BITSET_PRIVATE, value, &deadline, nullptr, FUTEX_BITSET_MATCH_ANY);
}

}  // namespace

void KernelSleep::wake(std::atomic<std::uint32_t>& word) {
  // There is one sleeper, so at most one thread is woken.
  syscall(SYS_futex, &word, FUTEX_WAKE_PRIVATE, 1, nullptr, nullptr, 0);
}

void KernelSleep::sleepWhile(std::atomic<std::uint32_t>& word, std::uint32_t value, Duration at_most) {
  const timespec deadline = deadlineAfter(at_most);
  // A sleep may end early: by a signal, or by the wake-up of a ring that an earlier round has already seen.
  while (word.load(std::memory_order_relaxed) == value && !isPast(deadline)) {
    futexWait(word, value, deadline);
  }
}

}  // namespace swiftlet
