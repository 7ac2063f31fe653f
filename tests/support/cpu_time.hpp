#pragma once
// CPU time for benchmarks: a shared machine's other work does not count.

#include <ctime>

namespace swiftlet::test {

/// Of this thread; of the process with CLOCK_PROCESS_CPUTIME_ID, where helper threads of a library count.
inline double cpuMilliseconds(clockid_t clock = CLOCK_THREAD_CPUTIME_ID) {
  timespec now{};
  clock_gettime(clock, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

/// What `work` takes [ms].
template <typename Work>
double timed(const Work& work, clockid_t clock = CLOCK_THREAD_CPUTIME_ID) {
  const double start = cpuMilliseconds(clock);
  work();
  return cpuMilliseconds(clock) - start;
}

}  // namespace swiftlet::test
