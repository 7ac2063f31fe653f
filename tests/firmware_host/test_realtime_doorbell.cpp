// Doorbell: nothing is lost, nothing waits longer than its bound, and nobody who is awake costs a call.

#include <dlfcn.h>
#include <linux/futex.h>
#include <signal.h>
#include <sys/syscall.h>

#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdarg>
#include <thread>
#include <vector>

#include "firmware_host/realtime/doorbell.hpp"

namespace {

std::atomic<const void*> watched_word{nullptr};
std::atomic<int> watched_calls{0};

}  // namespace

/// In front of the C library's: counts the futex calls on one word. It reads six arguments where the caller
/// may have passed fewer, as the C library's does: no business of the address sanitizer.
extern "C" [[gnu::no_sanitize_address]] long syscall(long number, ...) {
  using Function = long (*)(long, ...);
  static const auto kNext = reinterpret_cast<Function>(dlsym(RTLD_NEXT, "syscall"));
  constexpr std::size_t kMost = 6;
  std::array<long, kMost> a{};
  va_list list;
  va_start(list, number);
  for (long& value : a) value = va_arg(list, long);
  va_end(list);
  if (number == SYS_futex && reinterpret_cast<const void*>(a[0]) == watched_word.load()) ++watched_calls;
  return kNext(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}

namespace swiftlet {
namespace {

using Clock = std::chrono::steady_clock;
constexpr Duration kShort = Duration::fromMilliseconds(20);
/// Longer than any delay of a loaded machine: a wait that lasts this long was a lost wake-up.
constexpr Duration kLong = Duration::fromMilliseconds(20'000);

double secondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

TEST_CASE("a ring between ticket and wait ends the wait before it begins, without a system call") {
  Doorbell bell;
  watched_word = &bell;
  watched_calls = 0;
  const std::uint32_t ticket = bell.ticket();
  bell.ring();
  CHECK(bell.wait(ticket, kLong));
  CHECK(bell.ticket() == ticket + 1);
  for (int i = 0; i < 1000; ++i) bell.ring();
  CHECK(bell.wait(ticket, kLong));
  CHECK(bell.ticket() == ticket + 1001);
  CHECK(watched_calls == 0);
  watched_word = nullptr;
}

TEST_CASE("a wait without a ring lasts its bound and leaves the bell as it was") {
  Doorbell bell;
  const std::uint32_t ticket = bell.ticket();
  const auto start = Clock::now();
  CHECK(!bell.wait(ticket, kShort));
  CHECK(secondsSince(start) >= kShort.seconds());
  CHECK(bell.ticket() == ticket);
  const auto again = Clock::now();
  CHECK(!bell.wait(ticket, Duration{}));
  CHECK(!bell.wait(ticket, Duration::fromMilliseconds(-5)));
  CHECK(secondsSince(again) < 1);

  // The announcement was taken back: the next ring finds nobody asleep.
  watched_word = &bell;
  watched_calls = 0;
  bell.ring();
  CHECK(watched_calls == 0);
  watched_word = nullptr;
  CHECK(bell.wait(ticket, kLong));
}

TEST_CASE("a ring wakes a sleeper, who sees what was published before it") {
  Doorbell bell;
  int published = 0;
  const std::uint32_t ticket = bell.ticket();
  std::thread ringer([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    published = 7;
    bell.ring();
  });
  const auto start = Clock::now();
  CHECK(bell.wait(ticket, kLong));
  CHECK(secondsSince(start) < kLong.seconds() / 2);
  CHECK(published == 7);
  ringer.join();
}

TEST_CASE("a signal does not end a wait") {
  struct sigaction action {};
  struct sigaction before {};
  action.sa_handler = [](int) {};
  sigaction(SIGUSR1, &action, &before);
  Doorbell bell;
  const pthread_t sleeper = pthread_self();
  std::thread other([&] {
    for (int i = 0; i < 5; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(3));
      pthread_kill(sleeper, SIGUSR1);
    }
  });
  const auto start = Clock::now();
  CHECK(!bell.wait(bell.ticket(), kShort));
  CHECK(secondsSince(start) >= kShort.seconds());
  other.join();
  sigaction(SIGUSR1, &before, nullptr);
}

TEST_CASE("ping-pong: no wake-up is lost when both sides sleep at every turn") {
  constexpr int kTurns = 20'000;
  Doorbell to_left;
  Doorbell to_right;
  std::atomic<int> turn{0};
  std::atomic<int> lost{0};
  const auto play = [&](int parity, Doorbell& mine, Doorbell& other) {
    for (;;) {
      const std::uint32_t ticket = mine.ticket();
      const int now = turn.load(std::memory_order_relaxed);
      if (now >= kTurns || lost.load() > 0) break;
      if (now % 2 == parity) {
        turn.store(now + 1, std::memory_order_relaxed);
        other.ring();
      } else if (!mine.wait(ticket, kLong)) {
        ++lost;
      }
    }
    other.ring();
  };
  std::thread right([&] { play(1, to_right, to_left); });
  play(0, to_left, to_right);
  right.join();
  CHECK(lost == 0);
  CHECK(turn == kTurns);
}

TEST_CASE("many ringers, one sleeper: everything published is seen, no wait runs out") {
  constexpr int kRingers = 3;
  constexpr int kEach = 30'000;
  Doorbell bell;
  std::array<std::atomic<int>, kRingers> published{};
  std::vector<std::thread> ringers;
  for (int r = 0; r < kRingers; ++r) {
    ringers.emplace_back([&, r] {
      for (int i = 1; i <= kEach; ++i) {
        published[static_cast<std::size_t>(r)].store(i, std::memory_order_relaxed);
        bell.ring();
        // Uneven gaps, so that rings meet the sleeper awake, announcing itself and asleep.
        if (i % (7 + r) == 0) std::this_thread::yield();
        if (i % 500 == 0) std::this_thread::sleep_for(std::chrono::microseconds(100));
      }
    });
  }
  int sleeps = 0;
  int lost = 0;
  for (;;) {
    const std::uint32_t ticket = bell.ticket();
    int sum = 0;
    for (const auto& value : published) sum += value.load(std::memory_order_relaxed);
    if (sum == kRingers * kEach) break;
    if (!bell.wait(ticket, kLong)) {
      ++lost;
      break;
    }
    ++sleeps;
  }
  for (std::thread& ringer : ringers) ringer.join();
  CHECK(lost == 0);
  CHECK(sleeps > 0);
  CHECK(bell.ticket() == static_cast<std::uint32_t>(kRingers * kEach));
}

}  // namespace
}  // namespace swiftlet
