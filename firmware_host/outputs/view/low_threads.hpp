#pragma once
// The threads that answer the live view's connections: few, of low priority, with small stacks reserved at
// the start.

#include <array>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>

#include "firmware_host/outputs/view/view_server.hpp"
#include "firmware_host/realtime/flight_thread.hpp"

namespace swiftlet {

/// Gives the calling thread a niceness of 10: threads that only serve viewers give way to all others, even if
/// no thread may have real-time priority. If refused, the thread stays as it is.
void yieldToOthers();

/// When all threads are busy and all waiting places are taken, the accepting thread waits; further
/// connections stay in the kernel's short queue.
class LowThreads {
 public:
  /// Stack size in bytes: an answer takes some tens of kilobytes; sanitizers take more than everything else.
  static std::size_t stackBytes();
  static constexpr std::size_t kMostWaiting = 8;

  LowThreads();
  ~LowThreads() { shutdown(); }
  LowThreads(const LowThreads&) = delete;
  LowThreads& operator=(const LowThreads&) = delete;

  void enqueue(std::function<void()> job);
  /// Finishes queued jobs and joins.
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
