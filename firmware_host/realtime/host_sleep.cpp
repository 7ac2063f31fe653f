#include "firmware_host/realtime/host_sleep.hpp"

#include <ctime>

#include "firmware_host/realtime/stage_timer.hpp"

namespace swiftlet {

void sleepUntil(double host_seconds) {
  constexpr double kNanoseconds = 1e9;
  timespec at{};
  at.tv_sec = static_cast<std::time_t>(host_seconds);
  at.tv_nsec = static_cast<long>((host_seconds - static_cast<double>(at.tv_sec)) * kNanoseconds);
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
}

void sleepFor(Duration duration) { sleepUntil(wallSeconds() + duration.seconds()); }

}  // namespace swiftlet
