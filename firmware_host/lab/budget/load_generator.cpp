#include "firmware_host/lab/budget/load_generator.hpp"

#include <fmt/format.h>
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <system_error>

namespace swiftlet {
namespace {

// For the child processes: no allocation, no lock, nothing of the parent's; only system calls and arithmetic.

[[noreturn]] void burnCpu() {
  volatile double sum = 0;
  volatile std::uint64_t bits = 1;
  for (;;) {
    double x = sum;
    std::uint64_t b = bits;
    constexpr int kRound = 100'000;
    for (int i = 1; i < kRound; ++i) {
      x = x * 0.999 + 1.0 / i;
      b = b * 6364136223846793005ULL + 1442695040888963407ULL;  // any odd factor keeps the multiplier busy
    }
    sum = x;
    bits = b;
  }
}

[[noreturn]] void walkMemory(std::size_t bytes) {
  constexpr std::size_t kLine = 64;
  constexpr int kWalks = 4;
  for (;;) {
    void* mapping = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (mapping == MAP_FAILED) {
      sched_yield();
      continue;
    }
    auto* block = static_cast<volatile unsigned char*>(mapping);
    for (int walk = 0; walk < kWalks; ++walk) {
      for (std::size_t i = 0; i < bytes; i += kLine) block[i] = static_cast<unsigned char>(block[i] + 1);
    }
    munmap(mapping, bytes);
  }
}

/// Prepares a child: it must not outlive its parent nor inherit its priority or handlers.
void becomeWorker(pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL, 0, 0, 0);
  if (getppid() != parent) _exit(0);  // the parent ended before the call above
  const sched_param none{};
  sched_setscheduler(0, SCHED_OTHER, &none);
  // Ctrl-C goes to the whole group, but the parent decides when its load ends.
  signal(SIGINT, SIG_IGN);
  signal(SIGTERM, SIG_DFL);
  prctl(PR_SET_NAME, "swiftlet-load", 0, 0, 0);
}

}  // namespace

std::string LoadGenerator::start(const LoadSettings& settings) {
  stop();
  const pid_t parent = getpid();
  const int wanted = settings.cpu_workers + settings.memory_workers;
  for (int i = 0; i < wanted; ++i) {
    const pid_t child = fork();
    if (child == 0) {
      becomeWorker(parent);
      if (i < settings.cpu_workers) burnCpu();
      walkMemory(settings.memory_bytes);
    }
    if (child < 0) {
      const std::string reason = std::generic_category().message(errno);
      stop();
      return fmt::format("only {} of {} load processes could be created ({}): see `ulimit -u`", i, wanted,
                         reason);
    }
    workers_.push_back(child);
  }
  return {};
}

void LoadGenerator::stop() {
  for (const pid_t worker : workers_) kill(worker, SIGKILL);
  for (const pid_t worker : workers_) {
    while (waitpid(worker, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
  workers_.clear();
}

int LoadGenerator::running() const {
  int count = 0;
  for (const pid_t worker : workers_) {
    // Checks without reaping: stop still owns the process number.
    siginfo_t info{};
    if (waitid(P_PID, static_cast<id_t>(worker), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
        info.si_pid == 0) {
      ++count;
    }
  }
  return count;
}

}  // namespace swiftlet
