#pragma once
// Ending a run cleanly when the user, or systemd, asks for it.

#include <atomic>

namespace swiftlet {

/// Clears the flag; from now on SIGINT and SIGTERM set it, and end the program no more.
const std::atomic<bool>& stopOnSignal();

}  // namespace swiftlet
