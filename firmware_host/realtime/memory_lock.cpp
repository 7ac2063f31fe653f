#include "firmware_host/realtime/memory_lock.hpp"

#include <dlfcn.h>
#include <fmt/format.h>
#include <linux/capability.h>
#include <malloc.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <system_error>

#include "estimator/core/units.hpp"
#include "firmware_host/realtime/machine_files.hpp"

namespace swiftlet {
namespace {

constexpr const char* kLockRemedy =
    "grant the permission: `setcap cap_ipc_lock+ep` on the program, `LimitMEMLOCK=infinity` in its systemd "
    "unit, or `ulimit -l unlimited` (memlock in /etc/security/limits.conf)";

std::size_t pageBytes() { return static_cast<std::size_t>(sysconf(_SC_PAGESIZE)); }

std::int64_t mappedBytes() {
  std::ifstream file("/proc/self/statm");
  std::int64_t pages = 0;
  return file >> pages ? pages * static_cast<std::int64_t>(pageBytes()) : 0;
}

/// RLIMIT_MEMLOCK; -1: none.
std::int64_t lockLimit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_MEMLOCK, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return -1;
  return static_cast<std::int64_t>(
      std::min<rlim_t>(limit.rlim_cur, static_cast<rlim_t>(std::numeric_limits<std::int64_t>::max())));
}

/// Whether the thread's effective set has the capability that lifts the limit.
bool mayLockBeyondLimit() {
  return Machine("").hasCapability("/proc/thread-self/status", CAP_IPC_LOCK).value_or(false);
}

int threadsOfProcess() {
  std::error_code error;
  const std::filesystem::directory_iterator tasks("/proc/self/task", error);
  return error ? 0 : static_cast<int>(std::distance(begin(tasks), end(tasks)));
}

/// Function that limits a library to one thread.
struct LibraryFunction {
  const char* library;
  const char* symbol;
};
constexpr LibraryFunction kLibraryFunctions[] = {
    {"OpenBLAS", "openblas_set_num_threads"},
    {"OpenMP", "omp_set_num_threads"},
    {"MKL", "MKL_Set_Num_Threads"},
    {"OpenCV", "_ZN2cv13setNumThreadsEi"},  // cv::setNumThreads(int)
};
constexpr const char* kEnvironment[] = {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS",
                                        "CHOLMOD_OMP_NUM_THREADS"};

}  // namespace

MemoryLockReport lockMemory() {
  MemoryLockReport report;
  report.limit_bytes = lockLimit();
  report.mapped_bytes = mappedBytes();
  const bool limited = report.limit_bytes >= 0 && !mayLockBeyondLimit();
  const int wanted = limited ? MCL_CURRENT : MCL_CURRENT | MCL_FUTURE;
  if (mlockall(wanted) == 0) {
    report.current = true;
    report.future = !limited;
    if (limited) {
      report.message = fmt::format(
          "memory mapped from now on is not locked; RLIMIT_MEMLOCK of {} bytes might refuse it: {}",
          report.limit_bytes, kLockRemedy);
    }
    return report;
  }
  const int error = errno;
  report.message =
      limited
          ? fmt::format(
                "memory is not locked ({}): {:.1f} MiB are mapped, RLIMIT_MEMLOCK allows {:.1f} MiB; {}",
                std::generic_category().message(error), static_cast<double>(report.mapped_bytes) / kMebibyte,
                static_cast<double>(report.limit_bytes) / kMebibyte, kLockRemedy)
          : fmt::format("memory is not locked ({}): {}", std::generic_category().message(error), kLockRemedy);
  return report;
}

void unlockMemory() { munlockall(); }

nlohmann::ordered_json toJson(const MemoryLockReport& report) {
  return {{"current", report.current},
          {"future", report.future},
          {"limit_bytes", report.limit_bytes < 0 ? nlohmann::ordered_json("unlimited")
                                                 : nlohmann::ordered_json(report.limit_bytes)},
          {"mapped_bytes", report.mapped_bytes},
          {"message", report.message}};
}

void touchPages(void* memory, std::size_t bytes) {
  auto* first = static_cast<volatile unsigned char*>(memory);
  if (bytes == 0) return;
  for (std::size_t i = 0; i < bytes; i += pageBytes()) first[i] = first[i];
  // The range need not begin at a page's start, so its last byte may lie on one more page.
  first[bytes - 1] = first[bytes - 1];
}

#if defined(__GLIBC__)
namespace {
constexpr int kHeapBlockBytes = 4 * 1024 * 1024;  ///< larger ones get a mapping of their own
}

std::string confineMalloc() {
  std::string refused;
  const auto set = [&refused](int what, int value, const char* name) {
    if (mallopt(what, value) == 1) return;
    refused += fmt::format("{}malloc refused {} = {}", refused.empty() ? "" : "; ", name, value);
  };
  set(M_ARENA_MAX, 1, "M_ARENA_MAX");
  set(M_TRIM_THRESHOLD, std::numeric_limits<int>::max(), "M_TRIM_THRESHOLD");
  set(M_MMAP_THRESHOLD, kHeapBlockBytes, "M_MMAP_THRESHOLD");
  return refused;
}

void reserveHeap(std::size_t bytes) {
  // Blocks are held all at once, so that each is new, and are small enough to come from the heap instead of
  // mappings of their own.
  constexpr std::size_t kBlock = kHeapBlockBytes / 4;
  std::vector<void*> blocks;
  blocks.reserve(bytes / kBlock + 1);
  for (std::size_t held = 0; held < bytes; held += kBlock) {
    void* block = std::malloc(kBlock);
    if (block == nullptr) break;
    blocks.push_back(block);
    std::fill_n(static_cast<volatile unsigned char*>(block), kBlock, static_cast<unsigned char>(0));
  }
  for (void* block : blocks) std::free(block);
}
#else
std::string confineMalloc() { return "this C library's malloc cannot be confined: unchanged"; }
void reserveHeap(std::size_t) {}
#endif

LibraryReport confineLibraries() {
  for (const char* variable : kEnvironment) setenv(variable, "1", 1);
  LibraryReport report;
  std::string names;
  for (const LibraryFunction& entry : kLibraryFunctions) {
    void* symbol = dlsym(RTLD_DEFAULT, entry.symbol);
    report.libraries.push_back({entry.library, symbol != nullptr});
    if (symbol == nullptr) continue;
    reinterpret_cast<void (*)(int)>(symbol)(1);
    names += (names.empty() ? "" : ", ") + std::string(entry.library);
  }
  report.threads = threadsOfProcess();
  report.message = names.empty() ? std::string("no library with its own threads is linked")
                                 : "limited to one thread: " + names;
  return report;
}

nlohmann::ordered_json toJson(const LibraryReport& report) {
  nlohmann::ordered_json libraries = nlohmann::ordered_json::object();
  for (const LibraryThreads& library : report.libraries) {
    libraries[library.library] = library.linked ? "one thread" : "not linked";
  }
  return {{"libraries", libraries}, {"threads", report.threads}, {"message", report.message}};
}

std::int64_t MemoryTable::total() const {
  return std::accumulate(rows_.begin(), rows_.end(), std::int64_t{0},
                         [](std::int64_t sum, const Row& row) { return sum + row.bytes; });
}

std::string MemoryTable::text() const {
  constexpr std::string_view kTotal = "total";
  std::size_t width = kTotal.size();
  for (const Row& row : rows_) width = std::max(width, row.what.size());
  const auto all = static_cast<double>(total());
  const auto line = [&](std::string_view what, std::int64_t bytes) {
    const auto amount = static_cast<double>(bytes);
    return fmt::format("  {:<{}}{:>12.3f} MiB{:>7.1f} %\n", what, width, amount / kMebibyte,
                       all > 0 ? kPercent * amount / all : 0.0);
  };
  std::string text = "reserved memory\n";
  for (const Row& row : rows_) text += line(row.what, row.bytes);
  return text + line(kTotal, total());
}

nlohmann::ordered_json MemoryTable::json() const {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const Row& row : rows_) rows.push_back({{"what", row.what}, {"bytes", row.bytes}});
  return {{"rows", rows}, {"total_bytes", total()}};
}

}  // namespace swiftlet
