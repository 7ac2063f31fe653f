#pragma once
// A thread beside a run that follows it at its own pace: who reads a LiveOutlet.
//
// Ends when it is told to, or with this object: to be declared after all that its entry uses.

#include <atomic>
#include <functional>
#include <string>

#include "firmware_host/realtime/flight_thread.hpp"

namespace swiftlet {

class FollowerThread {
 public:
  FollowerThread() = default;
  ~FollowerThread() { end(); }
  FollowerThread(const FollowerThread&) = delete;
  FollowerThread& operator=(const FollowerThread&) = delete;

  /// InputError of `file` and `field`, which asked for it, where there is no thread.
  void start(const ThreadSettings& settings, const std::string& file, const std::string& field,
             std::function<void()> entry);
  /// Waits for the entry to return, which looks at ending().
  void end();
  [[nodiscard]] bool ending() const { return ending_.load(std::memory_order_relaxed); }

  /// For the entry: `turn(now)` every `period` seconds of the host's clock, until it is to end. A thread that
  /// came late does not hurry after.
  void repeat(double period, const std::function<void(double now)>& turn) const;

 private:
  std::atomic<bool> ending_{false};
  FlightThread thread_;
};

}  // namespace swiftlet
