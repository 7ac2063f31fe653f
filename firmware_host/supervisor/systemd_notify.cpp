#include "firmware_host/supervisor/systemd_notify.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <functional>

namespace swiftlet {
namespace {

/// systemd advises half of WATCHDOG_USEC. With a quarter, three consecutive feeds must be late before it
/// kills a working flight.
constexpr std::uint64_t kFeedsPerLimit = 4;
constexpr std::int64_t kNanosecondsPerMicrosecond = 1000;
constexpr std::size_t kMessageBytes = 512;

std::optional<std::uint64_t> numberIn(const char* variable) {
  const char* text = std::getenv(variable);
  if (text == nullptr) return std::nullopt;
  std::uint64_t number = 0;
  const char* last = text + std::strlen(text);
  const auto [end, error] = std::from_chars(text, last, number);
  if (error != std::errc{} || end != last) return std::nullopt;
  return number;
}

}  // namespace

SystemdNotify::SystemdNotify() {
  const char* path = std::getenv("NOTIFY_SOCKET");
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  if (path == nullptr || (path[0] != '/' && path[0] != '@')) return;
  const std::size_t length = std::strlen(path);
  if (length >= sizeof(address.sun_path)) return;
  std::copy_n(path, length, address.sun_path);
  if (path[0] == '@') address.sun_path[0] = '\0';  // abstract socket name, not a file
  socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket_ < 0) return;
  const auto bytes = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + length);
  if (::connect(socket_, reinterpret_cast<const sockaddr*>(&address), bytes) != 0) {
    ::close(socket_);
    socket_ = -1;
    return;
  }
  const std::optional<std::uint64_t> limit = numberIn("WATCHDOG_USEC");
  const std::optional<std::uint64_t> process = numberIn("WATCHDOG_PID");
  const bool is_us = std::getenv("WATCHDOG_PID") == nullptr ||
                     (process && *process == static_cast<std::uint64_t>(::getpid()));
  if (limit && *limit > 0 && is_us) {
    watchdog_period_ =
        Duration{static_cast<std::int64_t>(*limit / kFeedsPerLimit) * kNanosecondsPerMicrosecond};
  }
}

SystemdNotify::~SystemdNotify() {
  if (socket_ >= 0) ::close(socket_);
}

bool SystemdNotify::send(std::string_view message) const {
  return socket_ < 0 || ::send(socket_, message.data(), message.size(), MSG_DONTWAIT | MSG_NOSIGNAL) >= 0;
}

bool SystemdNotify::ready() const { return send("READY=1"); }

bool SystemdNotify::stopping() const {
  // If systemd requested the stop, STOPPING does not disarm a watchdog that was fed since.
  return send(watchdog_period_ ? "STOPPING=1\nWATCHDOG_USEC=0" : "STOPPING=1");
}

void SystemdNotify::status(std::string_view line) {
  const std::uint64_t hash = std::hash<std::string_view>{}(line);
  if (socket_ < 0 || hash == status_hash_) return;
  status_hash_ = hash;
  std::array<char, kMessageBytes> message;
  const auto end = fmt::format_to_n(message.data(), message.size(), "STATUS={}", line);
  send({message.data(), std::min(end.size, message.size())});
}

void SystemdNotify::watchdog(Stamp now) {
  if (!watchdog_period_ || (next_feed_ && now < *next_feed_)) return;
  next_feed_ = now + *watchdog_period_;
  send("WATCHDOG=1");
}

bool SystemdNotify::limitWatchdog(Duration limit) const {
  if (!watchdog_period_) return true;  // the message would enable the watchdog
  std::array<char, kMessageBytes> message;
  const auto end = fmt::format_to_n(message.data(), message.size(), "WATCHDOG_USEC={}",
                                    limit.ns / kNanosecondsPerMicrosecond);
  return send({message.data(), end.size});
}

}  // namespace swiftlet
