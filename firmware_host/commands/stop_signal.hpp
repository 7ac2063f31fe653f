#pragma once
// How signals from user, systemd and terminal act on a run: they end it cleanly or not at all.

#include <atomic>

namespace swiftlet {

/// Clears the flag. From now on SIGINT and SIGTERM set it instead of ending the program. Writes to a closed
/// pipe (SIGPIPE) or to a terminal that belongs to another program (SIGTTOU) do not end it either.
const std::atomic<bool>& stopOnSignal();

/// From now on SIGINT and SIGTERM end the program again: for what follows a part that reads the flag.
void endOnSignal();

/// Clears the flag. From now on SIGHUP, the terminal's end, sets it instead of ending the program. A program
/// started with SIGHUP ignored (nohup) keeps ignoring it.
std::atomic<bool>& surviveHangUp();

}  // namespace swiftlet
