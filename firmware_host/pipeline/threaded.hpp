#pragma once
// The threaded executor: every thread of wiring.cpp for itself, fed by devices or by a log that is let out as
// devices would.
//
// Threads: the input's, `propagate`, `track`, `smooth` and `mesh` are the flight path; `map`, `loop`, `log`
// and `record` follow at the lowest priority. The flight path sleeps on doorbells with a bounded wait; the
// others look at their arrows every few milliseconds, so that nobody on the flight path calls the kernel for
// them. A thread that does not get its priority or CPU runs without; the reports say so.

#include <string>
#include <vector>

#include "firmware_host/pipeline/run_control.hpp"
#include "firmware_host/pipeline/sensor_input.hpp"
#include "firmware_host/pipeline/wiring.hpp"
#include "firmware_host/realtime/flight_thread.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

struct ThreadedOptions {
  RealtimeGroup realtime;
  /// Called once with what the threads got, before the first message.
  std::function<void(const std::vector<ThreadReport>&)> started;
};

struct ThreadedReport {
  bool finished = true;  ///< false: stopped
  std::vector<ThreadReport> threads;
  std::vector<std::string> faults;  ///< what ended a thread before its time: "name: what"
};

/// Starts the threads, waits for the end of the input and of all that follows from it, joins. What ended the
/// input before its time is thrown again here, after an orderly end.
ThreadedReport runThreaded(SensorInput& input, Wiring& wiring, const ThreadedOptions& options,
                           const RunControl& control);

}  // namespace swiftlet
