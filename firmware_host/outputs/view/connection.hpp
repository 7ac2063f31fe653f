#pragma once
// A connection of the web server: one small request that must arrive soon, and writes that end if the reader
// takes nothing or the server ends.
//
// Only the request's first line, Host and Origin are passed on; everything else that a client sends is
// ignored.

#include <atomic>
#include <cstddef>
#include <string>

namespace swiftlet {

class Connection {
 public:
  static constexpr std::size_t kMostLine = 1024;  ///< bytes of one line that is passed on
  static constexpr std::size_t kMostRequest =
      16384;                                     ///< bytes: browsers send cookies of other pages of the host
  static constexpr double kRequestPatience = 3;  ///< s

  /// `socket` stays open as long as this object. `deadline`: host time after which nothing waits any longer;
  /// another thread lowers it to end everything.
  Connection(int socket, const std::atomic<double>& deadline, double patience);

  /// Reads the request's head. False: none arrived in time, it is too long, or it is not a request.
  bool readHead();

  /// Whether a write gave up on a reader that took nothing, before the server's end.
  [[nodiscard]] bool gaveUp() const { return gave_up_; }

  /// Whether a write failed; nothing more can be sent.
  [[nodiscard]] bool failed() const { return failed_; }
  /// Bytes of the head from readHead() that read() has not returned yet.
  [[nodiscard]] std::size_t unread() const { return head_.size() - read_; }
  std::size_t read(char* to, std::size_t size);
  /// Waits at most `patience` for a reader that takes nothing. Returns the bytes sent; -1: nothing more can
  /// be sent.
  std::ptrdiff_t write(const char* from, std::size_t size);
  [[nodiscard]] int socket() const { return socket_; }

 private:
  bool wait(short events, double until) const;
  bool keep(const std::string& raw);

  int socket_;
  const std::atomic<double>& deadline_;
  double patience_;
  std::string head_;
  std::size_t read_ = 0;
  bool failed_ = false;
  bool gave_up_ = false;
};

}  // namespace swiftlet
