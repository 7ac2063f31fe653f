#pragma once
// A thread that only sleeps until the next multiple of its period and notes how late it wakes: the latency
// that the machine itself causes for a real-time thread of that priority, as measured by cyclictest.
//
// Threads: start and stop from one thread; call lateness() and the counts after stop. Memory: fixed,
// allocated by start; the loop allocates nothing. stop waits for at most one period (and the machine's
// lateness).

#include <atomic>
#include <cstdint>

#include "estimator/core/stamp.hpp"
#include "firmware_host/realtime/flight_thread.hpp"
#include "firmware_host/realtime/latency_histogram.hpp"

namespace swiftlet {

class BareTimerLoop {
 public:
  static constexpr Duration kPeriod = Duration::fromMilliseconds(1);

  BareTimerLoop() = default;
  ~BareTimerLoop() { stop(); }
  BareTimerLoop(const BareTimerLoop&) = delete;
  BareTimerLoop& operator=(const BareTimerLoop&) = delete;

  /// Restarts with empty figures; if already running, only reports.
  ThreadReport start(const ThreadSettings& settings, Duration period = kPeriod);
  void stop();

  /// s, one entry per wake-up.
  [[nodiscard]] const LatencyHistogram& lateness() const { return lateness_; }
  /// Periods that had passed before the thread woke for them. Each is part of the lateness of the previous
  /// wake-up and has no entry of its own.
  [[nodiscard]] std::uint64_t skipped() const { return skipped_; }

 private:
  void loop();

  FlightThread thread_;
  LatencyHistogram lateness_;
  Duration period_ = kPeriod;
  std::uint64_t skipped_ = 0;
  std::atomic<bool> stop_{false};
};

}  // namespace swiftlet
