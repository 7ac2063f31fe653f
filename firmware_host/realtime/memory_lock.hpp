#pragma once
// Makes memory resident before the flight and keeps it so: locking, touching, and limits on malloc and
// numerical libraries. Everything here is for the time before arm(). Outcomes are values.

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace swiftlet {

struct MemoryLockReport {
  bool current = false;           ///< everything mapped now stays resident
  bool future = false;            ///< everything mapped later stays resident, too
  std::int64_t limit_bytes = -1;  ///< RLIMIT_MEMLOCK; -1: none
  std::int64_t mapped_bytes = 0;  ///< mapped by the process at the time of the call
  std::string message;            ///< what is missing and the remedy; empty: both locked
};

/// mlockall(MCL_CURRENT | MCL_FUTURE). If all memory fits below RLIMIT_MEMLOCK but the process may not exceed
/// this limit (CAP_IPC_LOCK), only what is mapped now is locked: a later allocation refused because of the
/// limit would be worse than a page fault, and by then the flight path has all its memory.
MemoryLockReport lockMemory();
void unlockMemory();
nlohmann::ordered_json toJson(const MemoryLockReport& report);

/// Makes every page of a writable range resident and private by writing its content back unchanged. No other
/// thread may write there meanwhile.
void touchPages(void* memory, std::size_t bytes);

/// Keeps malloc's memory compact and resident. Call once, before other threads exist.
/// - One arena (M_ARENA_MAX 1): by default each thread gets its own arena, and other threads cannot reuse
///   memory that it frees. Threads then share a lock; flight threads never take it since they do not
///   allocate.
/// - The heap is never trimmed (M_TRIM_THRESHOLD): returned pages cost page faults when they are needed
///   again, and the address space lock on which every thread's page faults wait.
/// - Blocks below 4 MiB come from the heap (M_MMAP_THRESHOLD; glibc starts at 128 KiB, less than an image,
///   and adapts it): otherwise each image would be mapped, faulted in and unmapped at every frame. Larger
///   blocks are rare, exist from start to end, and would leave holes.
///
/// Returns the settings that were refused; empty: all are set. Without glibc, returns that nothing was done.
std::string confineMalloc();
/// Grows the heap by `bytes`, makes it resident and returns it to malloc, so that low-priority threads find
/// memory without asking the kernel. Call after confineMalloc, which keeps the heap from shrinking.
void reserveHeap(std::size_t bytes);

/// A numerical library that could run its own threads.
struct LibraryThreads {
  std::string library;
  bool linked = false;  ///< found in this process and limited to one thread
};
struct LibraryReport {
  std::vector<LibraryThreads> libraries;  ///< OpenBLAS, OpenMP, MKL, OpenCV
  int threads = 0;                        ///< number in this process afterwards; 0: unknown
  std::string message;                    ///< one line for the start
};
/// Limits every linked library to the calling thread. Libraries are found by name at run time, so nothing is
/// linked for this. Environment variables have no effect here, since libraries read them before main; they
/// are set for child processes. OpenMP's setting applies to the calling thread: call before other threads are
/// created, and first in each thread that calls such a library.
LibraryReport confineLibraries();
nlohmann::ordered_json toJson(const LibraryReport& report);

/// Reserved memory by purpose, as stated by the objects that reserve it.
class MemoryTable {
 public:
  struct Row {
    std::string what;
    std::int64_t bytes = 0;
  };

  void add(std::string what, std::int64_t bytes) { rows_.push_back({std::move(what), bytes}); }
  [[nodiscard]] const std::vector<Row>& rows() const { return rows_; }
  [[nodiscard]] std::int64_t total() const;
  /// One line per row in the order of adding, with its share of the total; the total last.
  [[nodiscard]] std::string text() const;
  /// {"rows": [{"what", "bytes"}], "total_bytes"}
  [[nodiscard]] nlohmann::ordered_json json() const;

 private:
  std::vector<Row> rows_;
};

}  // namespace swiftlet
