#include "drivers/timesync/realtime_clock.hpp"

#include <sys/timerfd.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <ctime>

namespace swiftlet {
namespace {

constexpr std::size_t kReadings = 10;
constexpr int kTries = 3;  // a step among the readings is rare, two in a row are not to be waited out
// Real time and its slewing make stamps this much younger than now look as if they came after it.
constexpr Duration kFuture = {1'000'000};

Stamp now(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return {static_cast<std::int64_t>(t.tv_sec) * 1'000'000'000 + t.tv_nsec};
}

}  // namespace

DeviceFault RealtimeClock::arm() {
  // Never expires in a machine's life; a clock that is set cancels it, which is all that it is for.
  itimerspec far{};
  far.it_value.tv_sec = static_cast<time_t>(now(CLOCK_REALTIME).ns / 1'000'000'000) + 1'000'000'000;
  const int flags = TFD_TIMER_ABSTIME | TFD_TIMER_CANCEL_ON_SET;
  // Set while arming: the kernel says ECANCELED and has armed it.
  if (timerfd_settime(fd_, flags, &far, nullptr) != 0 && errno != ECANCELED) {
    return deviceFault(DeviceFaultKind::kFailed, errno, "a timer that hears of clock steps");
  }
  return {};
}

DeviceFault RealtimeClock::open() {
  close();
  fd_ = timerfd_create(CLOCK_REALTIME, TFD_NONBLOCK | TFD_CLOEXEC);
  if (fd_ < 0) return openFault(errno, "a timer that hears of clock steps");
  const DeviceFault fault = arm();
  if (!fault.ok()) close();
  return fault;
}

void RealtimeClock::close() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

bool RealtimeClock::wasSet() {
  if (fd_ < 0) return false;
  std::uint64_t expirations = 0;
  if (read(fd_, &expirations, sizeof expirations) >= 0) return true;
  if (errno != ECANCELED) return false;
  (void)arm();
  return true;
}

Status RealtimeClock::update() {
  if (wasSet()) offset_.expire();
  if (!offset_.due(monotonicNow())) return okStatus();
  Status status;
  for (int i = 0; i < kTries; ++i) {
    std::array<ClockReading, kReadings> readings;
    for (ClockReading& r : readings) r = {monotonicNow(), now(CLOCK_REALTIME), monotonicNow()};
    status = offset_.measure(readings);
    if (status.ok()) break;
  }
  return status;
}

Status RealtimeClock::toMonotonic(Stamp real, Stamp& monotonic) {
  Status status = update();
  if (!status.ok()) return status;
  status = offset_.toMonotonic(real, monotonic);
  if (!status.ok() || monotonic - monotonicNow() <= kFuture) return status;
  offset_.expire();
  status = update();
  return status.ok() ? offset_.toMonotonic(real, monotonic) : status;
}

}  // namespace swiftlet
