#include "firmware_host/commands/stop_signal.hpp"

#include <csignal>

namespace swiftlet {
namespace {

std::atomic<bool> stop_asked{false};

extern "C" void askToStop(int /*signal*/) { stop_asked.store(true, std::memory_order_relaxed); }

}  // namespace

const std::atomic<bool>& stopOnSignal() {
  stop_asked.store(false, std::memory_order_relaxed);
  std::signal(SIGINT, askToStop);
  std::signal(SIGTERM, askToStop);
  return stop_asked;
}

}  // namespace swiftlet
