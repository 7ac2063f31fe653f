#include "firmware_host/pipeline/follower_thread.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "drivers/calibration/input_error.hpp"
#include "firmware_host/pipeline/host_sleep.hpp"
#include "firmware_host/pipeline/stage_timer.hpp"

namespace swiftlet {

void FollowerThread::start(const ThreadSettings& settings, const std::string& file, const std::string& field,
                           std::function<void()> entry) {
  name_ = settings.name;
  const ThreadReport report =
      thread_.start(settings, [this, entry = std::move(entry)] { runBeating(heart_, entry); });
  if (!report.started) throw InputError(file, 0, field, report.message, "");
}

bool FollowerThread::end(Duration limit) {
  tellEnd();
  if (abandoned_) return false;
  if (thread_.joinWithin(limit)) {
    if (fault_.empty()) fault_ = thread_.fault();
    return true;
  }
  abandoned_ = true;
  fault_ =
      fmt::format("thread {} did not end within {:.1f} s and was left behind{}{}", name_, limit.seconds(),
                  *heart_.read().doing == '\0' ? "" : ", last seen at: ", heart_.read().doing);
  thread_.abandon();
  return false;
}

void FollowerThread::repeat(double period, const std::function<void(double now)>& turn) {
  double next = wallSeconds();
  while (!ending()) {
    heart_.beat();
    const double now = wallSeconds();
    turn(now);
    next = std::max(next + period, now);
    sleepUntil(next);
  }
}

}  // namespace swiftlet
