#pragma once
// An autopilot told of the estimate while it flies by it: the thread that owns the port, or sends over that
// of the IMU, docs/mavlink.md.
//
// It reads a LiveOutlet, steps an AutopilotLink and sends what that says; nobody waits for it and it waits
// for nobody: a port that takes no bytes loses them, counted and noted with the remedy. Its priority is that
// of the mesh: below the flight path, above all that may take long, so that a pose does not age while a
// planner computes. Beside poses go obstacles (10 Hz), and texts of the supervisor's verdict: each reason not
// to arm when it comes and every 30 s, that all is ready, every change of health, who is late or lost and
// recovers; and, of its own, that states stop and that the supervisor does. From its second turn on it
// allocates nothing and takes no lock. A serial port that is unplugged is looked for five times a second; it
// and an autopilot that says nothing for 3 s are told to the log, with the remedy. Clock: CLOCK_MONOTONIC.
// Stamps of a log are moved there by the one difference that its player knows.

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
  /// Where another thread owns the link: nothing is opened or read here. Null: a port of its own.
  LinkOutbox* outbox = nullptr;
  int priority = 0;  ///< SCHED_FIFO; 0: none
  /// From the run's stamps to CLOCK_MONOTONIC, once it is known; none: they are of it.
  std::function<std::optional<Duration>()> to_host;
  /// After which reasons not to arm that still stand are said again, and writes that are refused noted again.
  Duration repeat = Duration::fromMilliseconds(30'000);
};

/// q_vehicle_body and the lever arm as the settings say them.
AutopilotLinkSettings linkSettings(const AutopilotGroup& settings);

class AutopilotThread : public Follower {
 public:
  /// Opens the port and begins. InputError naming the setting where it does not open. `outlet` outlives it.
  AutopilotThread(LiveOutlet& outlet, const AutopilotThreadOptions& options);

  /// What happened to the port since the last call; any one thread.
  bool drainEvents(const std::function<void(Stamp, const std::string&)>& take);

 private:
  class Work;
};

}  // namespace swiftlet
