#pragma once
// Runs another program and waits for it.

#include <atomic>
#include <string>
#include <vector>

namespace swiftlet {

struct ChildEnd {
  int exit_code = -1;      ///< -1: ended by a signal, or not started
  int signal = 0;          ///< signal that ended it
  int errno_of_start = 0;  ///< why it did not start
  bool stopped = false;    ///< `stop` became true, and the program was asked to end
};

/// Runs `command` (program and arguments) in `folder` and waits; its output goes to the file `output`. Once
/// `stop` is true it receives SIGTERM, and SIGKILL if it does not end within 10 s. It does not outlive this
/// program. Any thread. InputError if `output` cannot be written.
ChildEnd runChild(const std::vector<std::string>& command, const std::string& folder,
                  const std::string& output, const std::atomic<bool>& stop);

}  // namespace swiftlet
