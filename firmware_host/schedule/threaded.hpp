#pragma once
// The threaded schedule: every node on its own thread, fed by devices or by a log played back like devices.
//
// Threads: the input's, `propagate`, `track`, `smooth` and `mesh` are the flight path; `loop`, `map`, `log`
// and `record` run at the lowest priority. Each sleeps on its node's doorbell with a bounded wait. The flight
// path does not ring `log` and `record`, which check every few milliseconds, so it makes no system call for
// them. A thread that is not granted its priority or CPU runs without; the reports say so. Faults: a node
// whose thread could not start, threw or ended early is abandoned; the nodes behind it process what is left.
// The supervisor decides what that means for the flight.

#include <functional>
#include <string>
#include <vector>

#include "firmware_host/graph/graph.hpp"
#include "firmware_host/interfaces/run_control.hpp"
#include "firmware_host/interfaces/sensor_input.hpp"
#include "firmware_host/realtime/flight_thread.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// Longest time from a stop request to the end of the last thread.
inline constexpr Duration kLongestEnd = Duration::fromMilliseconds(2000);

struct ThreadedOptions {
  RealtimeGroup realtime;
  /// Called before the first thread starts, for each thread with a heartbeat.
  std::function<void(const char* name, const Heartbeat& heart)> member;
  /// Called from any thread, before the first thread returns because the run ends.
  std::function<void()> expect_end;
  /// Called every few milliseconds. True: a thread is lost without which the flight cannot continue.
  std::function<bool()> failed;
  /// Called once before the first message, with what the threads were granted.
  std::function<void(const std::vector<ThreadReport>&)> started;
  /// Called on a node's thread before each turn. False: the thread ends early. Tests throw and stall here.
  std::function<bool(const char* node)> before_turn;
};

struct ThreadedReport {
  bool finished = true;  ///< false: stopped on request
  std::vector<ThreadReport> threads;
  std::vector<std::string> faults;  ///< why threads ended early or were left behind: "name: what"
  bool left_behind = false;         ///< a thread is stuck
};

/// Starts the threads, waits until the input and all nodes have ended, joins. Rethrows what ended the input
/// early, after an orderly end.
ThreadedReport runThreaded(SensorInput& input, Graph& graph, const ThreadedOptions& options,
                           const RunControl& control);

}  // namespace swiftlet
