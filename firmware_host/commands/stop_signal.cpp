#include "firmware_host/commands/stop_signal.hpp"

#include <csignal>

namespace swiftlet {
namespace {

std::atomic<bool> stop_asked{false};
std::atomic<bool> hung_up{false};

extern "C" void askToStop(int /*signal*/) { stop_asked.store(true, std::memory_order_relaxed); }
extern "C" void noteHangUp(int /*signal*/) { hung_up.store(true, std::memory_order_relaxed); }

}  // namespace

const std::atomic<bool>& stopOnSignal() {
  stop_asked.store(false, std::memory_order_relaxed);
  std::signal(SIGINT, askToStop);
  std::signal(SIGTERM, askToStop);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGTTOU, SIG_IGN);
  return stop_asked;
}

void endOnSignal() {
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
}

std::atomic<bool>& surviveHangUp() {
  hung_up.store(false, std::memory_order_relaxed);
  if (std::signal(SIGHUP, noteHangUp) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
  return hung_up;
}

}  // namespace swiftlet
