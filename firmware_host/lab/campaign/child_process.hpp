#pragma once
// A program that is run beside this one and waited for.

#include <atomic>
#include <string>
#include <vector>

namespace swiftlet {

struct ChildEnd {
  int exit_code = -1;      ///< -1: it was ended by a signal, or never began
  int signal = 0;          ///< that ended it
  int errno_of_start = 0;  ///< it never began
  bool stopped = false;    ///< `stop` became true, and it was asked to end
};

/// Runs `command` (program and arguments) in `folder` and waits; what it prints goes to the file `output`.
/// Once `stop` is true it gets SIGTERM, and SIGKILL if that does not end it within 10 s. It does not outlive
/// this program. Any thread; InputError when `output` cannot be written.
ChildEnd runChild(const std::vector<std::string>& command, const std::string& folder,
                  const std::string& output, const std::atomic<bool>& stop);

}  // namespace swiftlet
