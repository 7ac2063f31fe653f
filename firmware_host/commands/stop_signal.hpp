#pragma once
// What the user, systemd and the terminal may do to a run: end it cleanly, or not at all.

#include <atomic>

namespace swiftlet {

/// Clears the flag; from now on SIGINT and SIGTERM set it, and end the program no more. Nor do writes to a
/// pipe that nobody reads (SIGPIPE) or to a terminal that belongs to another program (SIGTTOU).
const std::atomic<bool>& stopOnSignal();

/// Clears the flag; from now on SIGHUP, the terminal's end, sets it and does not end the program. A program
/// started with SIGHUP ignored (nohup) goes on ignoring it.
std::atomic<bool>& surviveHangUp();

}  // namespace swiftlet
