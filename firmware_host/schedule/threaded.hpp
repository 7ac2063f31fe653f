#pragma once
// The threaded schedule: every node on its own thread, fed by devices or by a log that is played like
// devices.
//
// Threads: the input's, `propagate`, `track`, `smooth` and `mesh` are the flight path; `loop`, `map`, `log`
// and `record` follow at the lowest priority. Each sleeps on its node's doorbell with a bounded wait. The
// flight path does not ring `log` and `record`, which check every few milliseconds, so it makes no system
// call for them. A thread that does not get its priority or CPU runs without it; the reports say so. Faults:
// a node whose thread could not start, threw or was ended early is abandoned; the nodes behind it process
// what is left. The supervisor decides what that means for the flight.

#include <functional>
#include <string>
#include <vector>

#include "firmware_host/graph/graph.hpp"
#include "firmware_host/interfaces/run_control.hpp"
#include "firmware_host/interfaces/sensor_input.hpp"
#include "firmware_host/realtime/flight_thread.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// From being told to stop to the end of the last thread.
inline constexpr Duration kLongestEnd = Duration::fromMilliseconds(2000);

struct ThreadedOptions {
  RealtimeGroup realtime;
  /// Called for each thread that beats, before the first starts.
  std::function<void(const char* name, const Heartbeat& heart)> member;
  /// Called, from any thread, before the first thread returns because the run ends.
  std::function<void()> expect_end;
  /// Asked every few milliseconds: a thread was lost without which there is no flight.
  std::function<bool()> failed;
  /// Called once with what the threads got, before the first message.
  std::function<void(const std::vector<ThreadReport>&)> started;
  /// Called on a node's thread before each turn; false: the thread ends early. Tests throw and stall here.
  std::function<bool(const char* node)> before_turn;
};

struct ThreadedReport {
  bool finished = true;  ///< false: stopped
  std::vector<ThreadReport> threads;
  std::vector<std::string> faults;  ///< what ended a thread before its time, or left it behind: "name: what"
  bool left_behind = false;         ///< a thread is stuck
};

/// Starts the threads, waits for the end of the input and of all that follows from it, joins. What ended the
/// input before its time is thrown again here, after an orderly end.
ThreadedReport runThreaded(SensorInput& input, Graph& graph, const ThreadedOptions& options,
                           const RunControl& control);

}  // namespace swiftlet
