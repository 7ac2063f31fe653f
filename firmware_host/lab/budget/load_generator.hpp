#pragma once
// A machine that is busy with something else: child processes that burn CPU time and walk memory, in the
// manner of `stress-ng --cpu N --vm N`, under SCHED_OTHER.
//
// When: start before memory is locked and threads are made. The children are forked (nothing to find on
//   disk, no second program); a fork marks all writable memory for copying at the next write, which would
//   show as page faults of the flight threads. The child touches nothing of its parent's and calls the
//   kernel only, so a fork beside other threads is safe all the same.
// End: stop or the destructor kills and reaps them. They die with the thread that started them, however it
//   ends (PR_SET_PDEATHSIG): start from one that lasts, as main's.

#include <sys/types.h>

#include <cstddef>
#include <string>
#include <vector>

namespace swiftlet {

struct LoadSettings {
  int cpu_workers = 2;     ///< arithmetic without end
  int memory_workers = 1;  ///< each maps, fills, walks and unmaps a block, without end
  std::size_t memory_bytes = std::size_t{64} * 1024 * 1024;  ///< of each; beyond the caches
};

class LoadGenerator {
 public:
  LoadGenerator() = default;
  ~LoadGenerator() { stop(); }
  LoadGenerator(const LoadGenerator&) = delete;
  LoadGenerator& operator=(const LoadGenerator&) = delete;

  /// Empty, or why not all of the workers could be made (those made are stopped).
  std::string start(const LoadSettings& settings);
  void stop();

  /// Workers that still run.
  [[nodiscard]] int running() const;
  [[nodiscard]] const std::vector<pid_t>& workers() const { return workers_; }

 private:
  std::vector<pid_t> workers_;
};

}  // namespace swiftlet
