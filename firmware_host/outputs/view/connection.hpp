#pragma once
// A connection as the web server reads and writes it: one small request that has to come soon, and writes
// that end when the reader takes nothing, or the server ends.
//
// Of a request only the first line, Host and Origin are handed on: what else a client sends is nobody's work.

#include <atomic>
#include <cstddef>
#include <string>

namespace swiftlet {

class Connection {
 public:
  static constexpr std::size_t kMostLine = 1024;  ///< bytes of one line that is handed on
  static constexpr std::size_t kMostRequest =
      16384;                                     ///< bytes: browsers send cookies of other pages of the host
  static constexpr double kRequestPatience = 3;  ///< s

  /// `socket` stays open for as long as this lives. `deadline`: host's time after which nothing waits any
  /// more; another thread lowers it to end all.
  Connection(int socket, const std::atomic<double>& deadline, double patience);

  /// Reads the request's head. False: none came in time, or it is too long or no request.
  bool readHead();

  /// A write gave up on a reader that took nothing, before the end of all.
  [[nodiscard]] bool gaveUp() const { return gave_up_; }

  /// A write failed: nothing more can be sent.
  [[nodiscard]] bool failed() const { return failed_; }
  /// What readHead() has read; a read takes from it.
  [[nodiscard]] std::size_t unread() const { return head_.size() - read_; }
  std::size_t read(char* to, std::size_t size);
  /// Waits for a reader who takes nothing, not longer than `patience`. Bytes taken; -1: nothing more can be
  /// sent.
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
