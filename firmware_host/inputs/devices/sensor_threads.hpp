#pragma once
// Runs the threads of an input without an executor: for recording and for inspecting devices.

#include <atomic>
#include <string>
#include <vector>

#include "firmware_host/inputs/devices/live_input.hpp"
#include "firmware_host/realtime/flight_thread.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

class SensorThreads {
 public:
  /// Starts the threads. Input and sink outlive this object.
  SensorThreads(SensorInput& input, SensorSink& sink, const RealtimeGroup& realtime);
  ~SensorThreads() { join(); }
  SensorThreads(const SensorThreads&) = delete;
  SensorThreads& operator=(const SensorThreads&) = delete;

  /// Requests the end and waits for it.
  void join();
  /// Describes what the threads were not granted.
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  std::atomic<bool> stop_{false};
  RunControl control_;
  std::array<FlightThread, LiveInput::kMostThreads> threads_;
  std::size_t started_ = 0;
  std::vector<std::string> warnings_;
};

}  // namespace swiftlet
