#include "firmware_host/lab/budget/bare_timer_loop.hpp"

#include <algorithm>
#include <ctime>

#include "drivers/device/monotonic_now.hpp"

namespace swiftlet {
namespace {

constexpr std::int64_t kNanosPerSecond = 1'000'000'000;

void sleepUntil(Stamp stamp) {
  const timespec time{stamp.ns / kNanosPerSecond, stamp.ns % kNanosPerSecond};
  // A signal ends the sleep early; the requested time stays the same.
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) != 0) {
  }
}

}  // namespace

ThreadReport BareTimerLoop::start(const ThreadSettings& settings, Duration period) {
  if (!thread_.joinable()) {
    lateness_ = {};
    skipped_ = 0;
    period_ = std::max(period, Duration{1000});  // 1 us; a shorter period is not a sleep
    stop_.store(false, std::memory_order_relaxed);
  }
  return thread_.start(settings, [this] { loop(); });
}

void BareTimerLoop::stop() {
  stop_.store(true, std::memory_order_relaxed);
  thread_.join();
}

void BareTimerLoop::loop() {
  Stamp due = monotonicNow() + period_;
  while (!stop_.load(std::memory_order_relaxed)) {
    sleepUntil(due);
    const Duration late = monotonicNow() - due;
    lateness_.add(late.seconds());
    const std::int64_t missed = late.ns / period_.ns;
    skipped_ += static_cast<std::uint64_t>(missed);
    due = due + Duration{(missed + 1) * period_.ns};
  }
}

}  // namespace swiftlet
