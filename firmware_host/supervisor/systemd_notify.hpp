#pragma once
// Tells systemd how the service is: the protocol of sd_notify(3), one datagram a message, without its
// library.
//
// Without NOTIFY_SOCKET in the environment every call does nothing. Nothing blocks, allocates or fails: what
// systemd does not take is lost, and repeated where it matters (the watchdog). One thread.

#include <cstdint>
#include <optional>
#include <string_view>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

class SystemdNotify {
 public:
  /// Reads NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID, and opens the socket.
  SystemdNotify();
  ~SystemdNotify();
  SystemdNotify(const SystemdNotify&) = delete;
  SystemdNotify& operator=(const SystemdNotify&) = delete;

  [[nodiscard]] bool wanted() const { return socket_ >= 0; }

  void ready();
  /// From here on TimeoutStopSec limits the end, and nothing may feed the watchdog: that would arm it again.
  /// False: not sent, to be called again.
  [[nodiscard]] bool stopping() const;
  /// One line for `systemctl status`; sent when it differs from the one before.
  void status(std::string_view line);
  /// Feeds the watchdog where it is due.
  void watchdog(Stamp now);
  /// The watchdog kills the process `limit` from now if nothing feeds it. False: not sent, to be called
  /// again.
  [[nodiscard]] bool limitWatchdog(Duration limit) const;

 private:
  bool send(std::string_view message) const;

  int socket_ = -1;
  std::optional<Duration> watchdog_period_;  ///< between two feeds; empty: systemd's watchdog is off
  std::optional<Stamp> next_feed_;
  std::uint64_t status_hash_ = 0;
};

}  // namespace swiftlet
