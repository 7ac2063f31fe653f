#include "firmware_host/realtime/memory_use.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <fstream>

namespace swiftlet {

std::int64_t residentBytes() {
  std::ifstream file("/proc/self/statm");
  std::int64_t size = 0;
  std::int64_t resident = 0;
  if (!(file >> size >> resident)) return 0;
  return resident * sysconf(_SC_PAGESIZE);
}

std::int64_t peakResidentBytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  constexpr std::int64_t kKibibyte = 1024;  // Linux returns ru_maxrss in KiB
  return usage.ru_maxrss * kKibibyte;
}

}  // namespace swiftlet
