#pragma once
// Reports the service's state to systemd by the protocol of sd_notify(3), one datagram per message, without
// its library.
//
// Without NOTIFY_SOCKET in the environment, every call does nothing. Nothing blocks, allocates or fails: a
// message that systemd does not take is lost; for essential ones the call says so, or they are repeated. One
// thread.

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

  /// False: not sent, call again.
  [[nodiscard]] bool ready() const;
  /// From here on TimeoutStopSec limits the end. Do not call watchdog() afterwards: it would arm the watchdog
  /// again. False: not sent, call again.
  [[nodiscard]] bool stopping() const;
  /// One line for `systemctl status`; sent if it differs from the previous one.
  void status(std::string_view line);
  /// Feeds the watchdog if it is due.
  void watchdog(Stamp now);
  /// Makes the watchdog kill the process `limit` from now if nothing feeds it. False: not sent, call again.
  [[nodiscard]] bool limitWatchdog(Duration limit) const;

 private:
  bool send(std::string_view message) const;

  int socket_ = -1;
  std::optional<Duration> watchdog_period_;  ///< between two feeds; empty: systemd's watchdog is disabled
  std::optional<Stamp> next_feed_;
  std::uint64_t status_hash_ = 0;
};

}  // namespace swiftlet
