#pragma once
// The thread of the cameras' trigger line: passes edges from a GPIO chip to the cameras' threads.

#include <span>

#include "drivers/gpio/edge_source.hpp"
#include "estimator/core/newest_shared.hpp"
#include "firmware_host/inputs/devices/edge_message.hpp"
#include "firmware_host/inputs/devices/rate_watch.hpp"
#include "firmware_host/interfaces/device_journal.hpp"
#include "firmware_host/interfaces/run_control.hpp"
#include "firmware_host/settings/device_settings.hpp"
#include "firmware_host/supervisor/heartbeat.hpp"

namespace swiftlet {

struct TriggerStatus {
  std::uint64_t edges = 0;
  std::uint64_t missed = 0;
  Stamp heard;  ///< host time at which the newest edge was read
};

class TriggerThread {
 public:
  /// `rate`: of the cameras [Hz].
  TriggerThread(const TriggerGroup& settings, double rate);

  DeviceFault open() { return source_.open(settings_); }
  void run(std::span<EdgeRing* const> cameras, const RunControl& control);
  /// Beats at each turn of run().
  [[nodiscard]] Heartbeat& heart() { return heart_; }

  [[nodiscard]] DeviceJournal& journal() { return journal_; }
  [[nodiscard]] TriggerStatus status() const {
    TriggerStatus status;
    static_cast<void>(status_.read(status));
    return status;
  }

 private:
  void watchQuality(std::size_t edges);

  EdgeSourceSettings settings_;
  Duration longest_silence_;
  Heartbeat heart_;
  DeviceJournal journal_;
  EdgeSource source_;
  RateWatch rate_;
  Stamp heard_;               ///< when the newest edge was read; before the first, when waiting began
  std::uint64_t number_ = 0;  ///< number of the newest edge if the kernel does not count edges
  TriggerStatus counted_;
  NewestShared<TriggerStatus> status_;
};

}  // namespace swiftlet
