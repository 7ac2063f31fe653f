#include "firmware_host/outputs/view/connection.hpp"

#include <poll.h>
#include <strings.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <string_view>

#include "estimator/core/units.hpp"
#include "firmware_host/realtime/stage_timer.hpp"

namespace swiftlet {
namespace {

constexpr double kLook = 0.1;  // s; how often a wait checks whether the server ends

bool isHeader(std::string_view line, std::string_view name) {
  return line.size() > name.size() && line[name.size()] == ':' &&
         strncasecmp(line.data(), name.data(), name.size()) == 0;
}

}  // namespace

Connection::Connection(int socket, const std::atomic<double>& deadline, double patience)
    : socket_(socket), deadline_(deadline), patience_(patience) {}

bool Connection::wait(short events, double until) const {
  for (;;) {
    const double now = wallSeconds();
    const double left = std::min(until, deadline_.load(std::memory_order_relaxed)) - now;
    if (left <= 0) return false;
    pollfd one{socket_, events, 0};
    const int ready = ::poll(&one, 1, 1 + static_cast<int>(std::min(left, kLook) * kToMs));
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) return false;
  }
}

bool Connection::readHead() {
  const double until = wallSeconds() + kRequestPatience;
  std::string raw;
  std::array<char, 2048> part{};
  while (raw.find("\r\n\r\n") == std::string::npos) {
    if (raw.size() > kMostRequest || !wait(POLLIN, until)) return false;
    const ssize_t count = ::recv(socket_, part.data(), part.size(), MSG_DONTWAIT);
    if (count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR)) return false;
    if (count > 0) raw.append(part.data(), static_cast<std::size_t>(count));
  }
  return keep(raw);
}

bool Connection::keep(const std::string& raw) {
  for (std::size_t at = 0; at < raw.size();) {
    const std::size_t end = raw.find("\r\n", at);
    if (end == std::string::npos || end == at) break;
    const std::string_view line = std::string_view(raw).substr(at, end - at);
    if (at == 0 || isHeader(line, "Host") || isHeader(line, "Origin")) {
      if (line.size() > kMostLine) return false;
      head_.append(line).append("\r\n");
    }
    at = end + 2;
  }
  head_ += "\r\n";
  return head_.size() > 4;
}

std::size_t Connection::read(char* to, std::size_t size) {
  const std::size_t count = std::min(size, head_.size() - read_);
  std::copy_n(head_.data() + read_, count, to);
  read_ += count;
  return count;
}

std::ptrdiff_t Connection::write(const char* from, std::size_t size) {
  while (!failed_) {
    const ssize_t count = ::send(socket_, from, size, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count >= 0) return count;
    if (errno == EINTR) continue;
    if (errno != EAGAIN && errno != EWOULDBLOCK) {
      failed_ = true;
    } else if (!wait(POLLOUT, wallSeconds() + patience_)) {
      failed_ = true;
      gave_up_ = wallSeconds() < deadline_.load(std::memory_order_relaxed);
    }
  }
  return -1;
}

}  // namespace swiftlet
