#include "firmware_host/inputs/devices/trigger_thread.hpp"

#include <poll.h>

#include <array>

#include "drivers/device/monotonic_now.hpp"
#include "firmware_host/inputs/devices/device_times.hpp"
#include "firmware_host/realtime/host_sleep.hpp"

namespace swiftlet {
namespace {

std::string lineOf(const TriggerGroup& settings) { return settings.line.empty() ? "0" : settings.line; }

}  // namespace

TriggerThread::TriggerThread(const TriggerGroup& settings, double rate)
    : journal_("trigger (" + settings.chip + ", line " + lineOf(settings) + ")"), rate_(rate) {
  settings_.chip = settings.chip;
  settings_.line = lineOf(settings);
  settings_.edges = settings.edge == "falling" ? EdgeKind::kFalling : EdgeKind::kRising;
  settings_.period = Duration::fromSeconds(1 / rate);
  longest_silence_ = longestSilence(rate);
}

void TriggerThread::run(std::span<EdgeRing* const> cameras, const RunControl& control) {
  heard_ = monotonicNow();
  while (!control.stopped()) {
    heart_.beat();
    if (!source_.isOpen()) {
      if (const DeviceFault fault = open(); !fault.ok()) {
        journal_.fault(monotonicNow(), fault);
        sleepFor(kReopenPeriod);
        continue;
      }
      heard_ = monotonicNow();
    }
    pollfd waiting{source_.fd(), POLLIN, 0};
    poll(&waiting, 1, kPollMilliseconds);
    std::array<EdgeEvent, 16> events;
    std::size_t count = 0;
    if (const DeviceFault fault = source_.read(events, count); !fault.ok()) {
      journal_.fault(monotonicNow(), fault);
      source_.close();
      continue;
    }
    const Stamp now = monotonicNow();
    for (const EdgeEvent& event : std::span(events).first(count)) {
      number_ = event.sequence ? *event.sequence : number_ + 1;
      for (EdgeRing* camera : cameras) static_cast<void>(camera->tryPush({event.stamp, number_}));
    }
    if (count > 0) {
      heard_ = now;
      watchQuality(count);
      counted_ = {source_.edges(), source_.missed(), now};
      status_.write(counted_);
    } else if (now - heard_ > longest_silence_) {
      journal_.fault(
          now, deviceFault(DeviceFaultKind::kSilent, 0, "no edge for %.1f s", (now - heard_).seconds()));
    }
  }
}

void TriggerThread::watchQuality(std::size_t edges) {
  const bool returned = journal_.standing() != DeviceFaultKind::kNone;
  journal_.works(heard_);
  if (returned) {
    rate_.restart(heard_);
  } else if (rate_.add(heard_, edges)) {
    if (rate_.tooFew() || rate_.tooMany()) {
      journal_.defect(heard_,
                      deviceFault(rate_.tooFew() ? DeviceFaultKind::kLossy : DeviceFaultKind::kNoisy, 0,
                                  "%.0f edges in a second, expected %.0f", rate_.seen(), rate_.expected()));
    } else {
      journal_.sound(heard_);
    }
  }
}

}  // namespace swiftlet
