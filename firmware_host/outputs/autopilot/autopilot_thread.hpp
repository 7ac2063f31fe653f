#pragma once
// Sends the estimate to an autopilot that flies by it: the thread that owns the autopilot's port, or sends
// over the IMU's port, docs/mavlink.md.
//
// It reads a LiveOutlet, steps an AutopilotLink and sends the link's output. It waits for no thread and no
// thread waits for it: bytes that the port does not accept are lost, counted, and logged with the remedy. Its
// priority is that of the mesh: below the flight path, above everything slow, so that a pose does not age
// while a planner computes. Besides poses it sends obstacles (10 Hz) and texts of the supervisor's verdict:
// each reason not to arm when it appears and every 30 s, readiness to arm, every change of health, members
// that are late, lost or recovered, and missing states or a stopped supervisor. From its second turn on it
// neither allocates nor takes a lock. It looks for a port that is missing at the start, or unplugged later,
// five times a second; such a port and an autopilot that is silent for 3 s are logged with the remedy. Clock:
// CLOCK_MONOTONIC. Stamps of a log are converted by the constant offset of its player.

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
  /// Outbox if another thread owns the link: nothing is opened or read here. Null: its own port.
  LinkOutbox* outbox = nullptr;
  int priority = 0;  ///< SCHED_FIFO; 0: none
  /// From the run's stamps to CLOCK_MONOTONIC, once it is known; none: they are of it.
  std::function<std::optional<Duration>()> to_host;
  /// Interval after which standing reasons not to arm are sent again, and rejected writes are logged again.
  Duration repeat = Duration::fromMilliseconds(30'000);
};

/// q_vehicle_body and the lever arm as the settings say them.
AutopilotLinkSettings linkSettings(const AutopilotGroup& settings);

class AutopilotThread : public Follower {
 public:
  /// Opens the port, or looks for it from now on, and begins. InputError naming the setting where only other
  /// settings help; std::runtime_error where a host's name is not resolved. `outlet` outlives it.
  AutopilotThread(LiveOutlet& outlet, const AutopilotThreadOptions& options);

  /// What happened to the port since the last call; any one thread.
  bool drainEvents(const std::function<void(Stamp, const std::string&)>& take);

 private:
  class Work;
};

}  // namespace swiftlet
