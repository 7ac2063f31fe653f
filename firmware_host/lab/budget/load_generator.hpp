#pragma once
// Keeps the machine busy: child processes that burn CPU time and walk through memory, like `stress-ng --cpu N
// --vm N`, under SCHED_OTHER.
//
// Start it before memory is locked and threads are created. The children are forked (no second program is
// needed). A fork marks all writable memory for copying at the next write, which would appear as page faults
// of the flight threads. The child uses nothing of its parent's and makes only system calls, so forking is
// safe even with other threads.
// End: stop or the destructor kills and reaps the children. They also die with the thread that started them,
// however it ends (PR_SET_PDEATHSIG), so start from a thread that lasts, such as main's.

#include <sys/types.h>

#include <cstddef>
#include <string>
#include <vector>

namespace swiftlet {

struct LoadSettings {
  int cpu_workers = 2;     ///< endless arithmetic
  int memory_workers = 1;  ///< each endlessly maps, fills, walks and unmaps a block
  std::size_t memory_bytes = std::size_t{64} * 1024 * 1024;  ///< of each worker; larger than the caches
};

class LoadGenerator {
 public:
  LoadGenerator() = default;
  ~LoadGenerator() { stop(); }
  LoadGenerator(const LoadGenerator&) = delete;
  LoadGenerator& operator=(const LoadGenerator&) = delete;

  /// Empty, or why not all workers could be started (those started are stopped).
  std::string start(const LoadSettings& settings);
  void stop();

  /// Number of workers still running.
  [[nodiscard]] int running() const;
  [[nodiscard]] const std::vector<pid_t>& workers() const { return workers_; }

 private:
  std::vector<pid_t> workers_;
};

}  // namespace swiftlet
