#pragma once
// The threaded executor: every thread of wiring.cpp for itself, on a log whose messages are let out at the
// times of their arrival, as sensors would.
//
// Threads: `source` reads and decodes ahead (it is not of the vehicle); `sensor`, `propagate`, `track`,
// `smooth`, `mesh` are the flight path; `log` and `record` follow at the lowest priority. The flight path
// sleeps on doorbells with a bounded wait; the others look at their arrows every few milliseconds, so that
// nobody on the flight path calls the kernel for them. A thread that does not get its priority or CPU runs
// without; the reports say so.

#include <string>
#include <vector>

#include "firmware_host/pipeline/lockstep.hpp"
#include "firmware_host/pipeline/log_feed.hpp"
#include "firmware_host/pipeline/wiring.hpp"
#include "firmware_host/realtime/flight_thread.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

struct ThreadedOptions {
  double speed = 1;  ///< times faster than recorded
  RealtimeGroup realtime;
  /// Called once with what the threads got, before the first message.
  std::function<void(const std::vector<ThreadReport>&)> started;
  /// Called on each thread as it begins and ends: tests arm their traps here.
  std::function<void(const char* thread, bool begins)> watch;
};

struct ThreadedReport {
  bool finished = true;  ///< false: stopped
  std::vector<ThreadReport> threads;
  std::vector<std::string> faults;  ///< what ended a thread before its time: "name: what"
  StageTimes lateness;              ///< of the sensor thread behind the log's times
};

/// Starts the threads, waits for the end of the feed and of all that follows from it, joins.
/// An InputError of the log's reader is thrown again here, after an orderly end.
ThreadedReport runThreaded(LogFeed& feed, Wiring& wiring, const ThreadedOptions& options,
                           const RunControl& control);

}  // namespace swiftlet
