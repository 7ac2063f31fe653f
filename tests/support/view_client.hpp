#pragma once
// A viewer of the live view as a plain socket, which may be as slow and as rude as a test wants.

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <utility>

namespace swiftlet {

/// A port that nobody serves at, as far as one can know.
inline int freePort() {
  const int probe = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  static_cast<void>(::bind(probe, reinterpret_cast<sockaddr*>(&address), size));
  static_cast<void>(::getsockname(probe, reinterpret_cast<sockaddr*>(&address), &size));
  ::close(probe);
  return ntohs(address.sin_port);
}

class ViewClient {
 public:
  /// `narrow`: with a buffer of some kilobytes, so that what is not read comes back to the sender soon.
  explicit ViewClient(int port, bool narrow = false) : port_(port), narrow_(narrow) {}
  ~ViewClient() { close(); }
  ViewClient(ViewClient&& other) noexcept
      : port_(other.port_),
        narrow_(other.narrow_),
        socket_(std::exchange(other.socket_, -1)),
        text_(std::move(other.text_)) {}
  ViewClient& operator=(ViewClient&&) = delete;

  bool connect() {
    close();
    socket_ = ::socket(AF_INET, SOCK_STREAM, 0);
    const int bytes = 4096;
    if (narrow_) setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof(bytes));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port_));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return ::connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0;
  }
  bool send(const std::string& text) {
    return ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size());
  }
  bool connectAndAsk(const std::string& path, const std::string& headers = "Host: 127.0.0.1\r\n") {
    return connect() && send("GET " + path + " HTTP/1.1\r\n" + headers + "\r\n");
  }
  /// Reads what comes within `seconds`, at most `bytes`. False: the other side has closed.
  bool readSome(double seconds, std::size_t bytes = 65536) {
    pollfd one{socket_, POLLIN, 0};
    constexpr double kMilli = 1000;
    if (::poll(&one, 1, static_cast<int>(seconds * kMilli)) <= 0) return true;
    std::array<char, 65536> part{};
    const ssize_t count = ::recv(socket_, part.data(), std::min(bytes, part.size()), 0);
    if (count <= 0) return false;
    text_.append(part.data(), static_cast<std::size_t>(count));
    return true;
  }
  /// All until the other side closes.
  std::string readAll() {
    while (readSome(1)) {
    }
    return text_;
  }
  [[nodiscard]] const std::string& text() const { return text_; }
  void close() {
    if (socket_ >= 0) ::close(std::exchange(socket_, -1));
  }

 private:
  int port_;
  bool narrow_;
  int socket_ = -1;
  std::string text_;
};

}  // namespace swiftlet
