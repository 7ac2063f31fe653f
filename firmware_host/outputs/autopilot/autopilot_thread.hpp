#pragma once
// Sends the estimate to an autopilot that uses it for flight. The thread owns the autopilot's port or sends
// over the IMU's port; docs/mavlink.md.
//
// It reads a LiveOutlet, steps an AutopilotLink and sends the link's output. It waits for no thread and no
// thread waits for it: bytes that the port does not accept are lost, counted, and logged with the remedy. Its
// priority is that of the mesh: below the flight path and above everything slow, so that poses stay fresh
// while a planner computes. Besides poses it sends obstacles (10 Hz) and texts about the supervisor's
// verdict: each reason not to arm, when it appears and every 30 s; readiness to arm; every change of health;
// members that are late, lost or recovered; missing states; a stopped supervisor. From its second turn on it
// neither allocates nor takes a lock. A port that is missing at the start or unplugged later is searched for
// five times a second; such a port, and an autopilot that is silent for 3 s, are logged with the remedy.
// Clock: CLOCK_MONOTONIC. Stamps of a log are converted by its player's constant offset.

#include <functional>
#include <optional>
#include <string>

#include "drivers/mavlink/autopilot_link.hpp"
#include "firmware_host/interfaces/follower_thread.hpp"
#include "firmware_host/interfaces/link_outbox.hpp"
#include "firmware_host/interfaces/live_outlet.hpp"
#include "firmware_host/settings/device_settings.hpp"

namespace swiftlet {

struct AutopilotThreadOptions {
  AutopilotGroup settings;
  /// Outbox, if another thread owns the link: no port is opened or read here. Null: own port.
  LinkOutbox* outbox = nullptr;
  int priority = 0;  ///< SCHED_FIFO priority; 0: none
  /// Offset from the run's stamps to CLOCK_MONOTONIC, once known. Unset: stamps are of CLOCK_MONOTONIC.
  std::function<std::optional<Duration>()> to_host;
  /// Interval after which persisting reasons not to arm are sent again, and rejected writes are logged again.
  Duration repeat = Duration::fromMilliseconds(30'000);
};

/// q_vehicle_body and the lever arm from the settings.
AutopilotLinkSettings linkSettings(const AutopilotGroup& settings);

class AutopilotThread : public Follower {
 public:
  /// Opens the port, or starts searching for it, and starts the thread. InputError naming the setting if only
  /// other settings help; std::runtime_error if a host's name cannot be resolved. `outlet` outlives this
  /// object.
  AutopilotThread(LiveOutlet& outlet, const AutopilotThreadOptions& options);

  /// Passes what happened to the port since the last call. For one thread, which may be any.
  bool drainEvents(const std::function<void(Stamp, const std::string&)>& take);

 private:
  class Work;
};

}  // namespace swiftlet
