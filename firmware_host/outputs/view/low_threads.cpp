#include "firmware_host/outputs/view/low_threads.hpp"

#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace swiftlet {

void yieldToOthers() {
  constexpr int kNice = 10;
  // On Linux this affects only the calling thread.
  static_cast<void>(setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), kNice));
}

std::size_t LowThreads::stackBytes() {
#ifdef SWIFTLET_SANITIZED
  return kFlightStackBytes;
#else
  constexpr std::size_t kSmall = 256 * 1024;
  return kSmall;
#endif
}

LowThreads::LowThreads() {
  ThreadSettings settings;
  settings.name = "view_answer";
  settings.stack_bytes = stackBytes();
  for (FlightThread& thread : threads_) static_cast<void>(thread.start(settings, [this] { run(); }));
}

void LowThreads::enqueue(std::function<void()> job) {
  {
    std::unique_lock lock(mutex_);
    news_.wait(lock, [this] { return ended_ || waiting_.size() < kMostWaiting; });
    waiting_.push_back(std::move(job));
  }
  news_.notify_all();
}

void LowThreads::shutdown() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  news_.notify_all();
  for (FlightThread& thread : threads_) thread.join();
}

void LowThreads::run() {
  yieldToOthers();
  for (;;) {
    std::function<void()> job;
    {
      std::unique_lock lock(mutex_);
      news_.wait(lock, [this] { return ended_ || !waiting_.empty(); });
      if (waiting_.empty()) return;
      job = std::move(waiting_.front());
      waiting_.pop_front();
    }
    news_.notify_all();
    job();
  }
}

}  // namespace swiftlet
