#pragma once
// The threads that answer the live view's connections: few, low, on small stacks that are there from the
// start.

#include <array>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>

#include "firmware_host/outputs/view/view_server.hpp"
#include "firmware_host/realtime/flight_thread.hpp"

namespace swiftlet {

/// Threads that only serve viewers give way to all others, also where no thread may have real-time priority:
/// the calling thread gets a niceness of 10. Where that is refused it stays as it is.
void yieldToOthers();

/// A connection more than there are threads and places to wait makes the accepting thread wait: further ones
/// stay in the kernel's short queue.
class LowThreads {
 public:
  /// Bytes of a stack: an answer takes some tens of kilobytes, sanitizers more than all else.
  static std::size_t stackBytes();
  static constexpr std::size_t kMostWaiting = 8;

  LowThreads();
  ~LowThreads() { shutdown(); }
  LowThreads(const LowThreads&) = delete;
  LowThreads& operator=(const LowThreads&) = delete;

  void enqueue(std::function<void()> job);
  /// Does what waits and joins.
  void shutdown();

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable news_;
  std::deque<std::function<void()>> waiting_;
  bool ended_ = false;
  std::array<FlightThread, ViewServer::kWorkers> threads_;
};

}  // namespace swiftlet
