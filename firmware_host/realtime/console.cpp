#include "firmware_host/realtime/console.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>

namespace swiftlet {
namespace {

/// Bytes per system call. A pipe (4096 bytes) and a terminal (256) that report room accept this many at once,
/// even if line ends become two bytes. O_NONBLOCK is not used: it would also affect other programs on the
/// same stream.
constexpr std::size_t kPiece = 240;
/// Longest wait for a stalled reader. The log's arrows hold several times as much.
constexpr int kPatience = 100;  // ms

class Stream {
 public:
  explicit Stream(int file) : file_(file) {}

  void put(std::string_view text) {
    if (!take()) return;
    if (!torn_ || putAll("\n")) static_cast<void>(putAll(text));
    busy_.store(false, std::memory_order_release);
  }

 private:
  /// Keeps other threads out between the check for room and the write. Bounded, unlike a lock.
  bool take() {
    for (int waited = 0; busy_.exchange(true, std::memory_order_acquire); ++waited) {
      if (waited == kPatience) return false;
      ::poll(nullptr, 0, 1);
    }
    return true;
  }

  /// False: the rest is dropped.
  bool putAll(std::string_view text) {
    const std::size_t size = text.size();
    while (!text.empty()) {
      const ssize_t written = hasRoom() ? putPiece(text.substr(0, kPiece)) : 0;
      if (written <= 0) {
        torn_ = torn_ || text.size() < size;
        return false;
      }
      text.remove_prefix(static_cast<std::size_t>(written));
    }
    torn_ = false;
    return true;
  }

  /// False: nobody reads, for the moment or for good.
  bool hasRoom() {
    pollfd out{file_, POLLOUT, 0};
    int ready = ::poll(&out, 1, 0);
    if (ready == 0 && !still_) ready = ::poll(&out, 1, kPatience);
    still_ = ready == 0;
    return ready == 1 && out.revents == POLLOUT;
  }

  [[nodiscard]] ssize_t putPiece(std::string_view piece) const {
    const ssize_t sent = ::send(file_, piece.data(), piece.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    return sent < 0 && errno == ENOTSOCK ? ::write(file_, piece.data(), piece.size()) : sent;
  }

  const int file_;
  std::atomic<bool> busy_{false};
  // For the thread that has taken the stream.
  bool still_ = false;  ///< the last check found no room
  bool torn_ = false;   ///< the last message was cut off
};

Stream& out() {
  static Stream stream(STDOUT_FILENO);
  return stream;
}
Stream& err() {
  static Stream stream(STDERR_FILENO);
  return stream;
}

}  // namespace

void say(std::string_view text) { out().put(text); }
void warn(std::string_view text) { err().put(text); }

void warnAll(std::span<const std::string> warnings, std::size_t from) {
  for (std::size_t i = from; i < warnings.size(); ++i) warn("warning: " + warnings[i] + "\n");
}

void holdStandardStreams() {
  for (const int file : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(file, F_GETFD) != -1 || errno != EBADF) continue;
    // open() takes the lowest free number, which is this one. The direction is the wrong one, so that reads
    // and writes still fail.
    static_cast<void>(::open("/dev/null", file == STDIN_FILENO ? O_WRONLY : O_RDONLY));
  }
}

}  // namespace swiftlet
