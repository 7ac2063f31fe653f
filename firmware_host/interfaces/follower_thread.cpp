#include "firmware_host/interfaces/follower_thread.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "drivers/input/input_error.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "firmware_host/realtime/stage_timer.hpp"

namespace swiftlet {
namespace {

std::atomic<bool (*)(const char*)> watch_of_all{nullptr};

}  // namespace

void FollowerThread::start(const ThreadSettings& settings, const std::string& file, const std::string& field,
                           std::function<void()> entry) {
  name_ = settings.name;
  const ThreadReport report = thread_.start(settings, [this, entry = std::move(entry)] {
    runBeating(heart_, entry);
    returned_early_ = !ending_.load(std::memory_order_relaxed);
  });
  if (!report.started) throw InputError(file, 0, field, report.message, "");
}

bool FollowerThread::end(Duration limit) {
  tellEnd();
  if (abandoned_) return false;
  if (thread_.joinWithin(limit)) {
    if (fault_.empty()) fault_ = returned_early_ ? kReturnedEarly : thread_.fault();
    return true;
  }
  abandoned_ = true;
  fault_ = fmt::format("thread {} did not end within {:.1f} s and was abandoned{}{}", name_, limit.seconds(),
                       *heart_.read().doing == '\0' ? "" : ", last seen at: ", heart_.read().doing);
  thread_.abandon();
  return false;
}

bool FollowerThread::turn() {
  if (ending_.load(std::memory_order_relaxed)) return false;
  heart_.beat();
  const auto watch = watch_of_all.load(std::memory_order_relaxed);
  return watch == nullptr || watch(name_.c_str());
}

void FollowerThread::watchTurns(bool (*watch)(const char* thread)) {
  watch_of_all.store(watch, std::memory_order_relaxed);
}

void FollowerThread::repeat(double period, const std::function<void(double now)>& work) {
  double next = wallSeconds();
  while (turn()) {
    const double now = wallSeconds();
    work(now);
    next = std::max(next + period, now);
    sleepUntil(next);
  }
}

Follower::~Follower() {
  // An abandoned thread still uses its work, so the work is leaked.
  if (work_ && !work_->end()) static_cast<void>(work_.release());
}

nlohmann::ordered_json Follower::finish() {
  const std::string& fault = work_->thread_.fault();
  // An abandoned thread may still write its counters.
  if (!work_->end()) return {{"fault", fault}};
  nlohmann::ordered_json json = work_->json();
  if (!fault.empty()) json["fault"] = fault;
  return json;
}

}  // namespace swiftlet
