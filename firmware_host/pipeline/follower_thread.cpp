#include "firmware_host/pipeline/follower_thread.hpp"

#include <algorithm>
#include <utility>

#include "drivers/calibration/input_error.hpp"
#include "firmware_host/pipeline/host_sleep.hpp"
#include "firmware_host/pipeline/stage_timer.hpp"

namespace swiftlet {

void FollowerThread::start(const ThreadSettings& settings, const std::string& file, const std::string& field,
                           std::function<void()> entry) {
  const ThreadReport report = thread_.start(settings, std::move(entry));
  if (!report.started) throw InputError(file, 0, field, report.message, "");
}

void FollowerThread::end() {
  ending_.store(true, std::memory_order_relaxed);
  thread_.join();
}

void FollowerThread::repeat(double period, const std::function<void(double now)>& turn) const {
  double next = wallSeconds();
  while (!ending()) {
    const double now = wallSeconds();
    turn(now);
    next = std::max(next + period, now);
    sleepUntil(next);
  }
}

}  // namespace swiftlet
