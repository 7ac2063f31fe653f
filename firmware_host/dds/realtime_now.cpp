#include <ctime>

#include "firmware_host/dds/dds_thread.hpp"

namespace swiftlet {

Duration realtimeOffset() {
  const auto now = [](clockid_t clock) {
    timespec time{};
    clock_gettime(clock, &time);
    return static_cast<std::int64_t>(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
  };
  return {now(CLOCK_REALTIME) - now(CLOCK_MONOTONIC)};
}

}  // namespace swiftlet
