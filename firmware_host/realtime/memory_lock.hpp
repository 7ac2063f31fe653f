#pragma once
// Memory that is there before the flight and stays: locking, touching, and how malloc and the numerical
// libraries are held to it. Everything here is for the time before arm(); what it got is a value.

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace swiftlet {

struct MemoryLockReport {
  bool current = false;           ///< all that is mapped now stays resident
  bool future = false;            ///< and all that is mapped later
  std::int64_t limit_bytes = -1;  ///< RLIMIT_MEMLOCK; -1: none
  std::int64_t mapped_bytes = 0;  ///< what the process had mapped when it asked
  std::string message;            ///< what is missing and the remedy; empty: both locked
};

/// mlockall(MCL_CURRENT | MCL_FUTURE). Under a limit that all of the memory fits into, without the right
/// to go beyond it (CAP_IPC_LOCK), only what is mapped now is locked: a later allocation that the limit
/// refuses would be worse than a page fault, and the flight path has all of its memory by then.
MemoryLockReport lockMemory();
void unlockMemory();
nlohmann::ordered_json toJson(const MemoryLockReport& report);

/// Makes every page of a writable range resident and private by writing each back as it is. No other
/// thread may write there meanwhile.
void touchPages(void* memory, std::size_t bytes);

/// Keeps malloc in memory that neither shrinks nor spreads. Call it once, before other threads exist.
/// - One arena (M_ARENA_MAX 1): by default each thread gets its own arena, and other threads cannot reuse
///   memory that it frees. Threads then share a lock; flight threads never take it since they do not
///   allocate.
/// - The heap is never trimmed (M_TRIM_THRESHOLD): returned pages cost page faults when they are needed
///   again, and the address space lock on which every thread's page faults wait.
/// - Blocks below 4 MiB come from the heap (M_MMAP_THRESHOLD; glibc starts at 128 KiB, less than an image,
///   and adapts it): otherwise each image would be mapped, faulted in and unmapped at every frame. Larger
///   blocks are rare, exist from start to end, and would leave holes.
///
/// Returns the settings that were refused; empty: all are set. Without glibc it returns that nothing was
/// done.
std::string confineMalloc();
/// Grows the heap by `bytes`, makes it resident and gives it back to malloc, so that the low-priority
/// threads find their memory there and ask the kernel for none. After confineMalloc, which keeps it.
void reserveHeap(std::size_t bytes);

/// A numerical library that could run its own threads.
struct LibraryThreads {
  std::string library;
  bool linked = false;  ///< found in this process, and told to use one thread
};
struct LibraryReport {
  std::vector<LibraryThreads> libraries;  ///< OpenBLAS, OpenMP, MKL, OpenCV
  int threads = 0;                        ///< of this process afterwards; 0: the kernel does not say
  std::string message;                    ///< one line for the start
};
/// Tells every library that is linked (found by name at run time: nothing is linked for it) to use the
/// calling thread only. The environment variables are of no use here: the libraries have read them before
/// main; they are set all the same for child processes. OpenMP's setting holds for the thread that calls:
/// call it before the other threads are made, and first in each that calls such a library.
LibraryReport confineLibraries();
nlohmann::ordered_json toJson(const LibraryReport& report);

/// What was reserved for what, as the objects say when they are made.
class MemoryTable {
 public:
  struct Row {
    std::string what;
    std::int64_t bytes = 0;
  };

  void add(std::string what, std::int64_t bytes) { rows_.push_back({std::move(what), bytes}); }
  [[nodiscard]] const std::vector<Row>& rows() const { return rows_; }
  [[nodiscard]] std::int64_t total() const;
  /// One line a row in the order of adding, with the share of the total; the total last.
  [[nodiscard]] std::string text() const;
  /// {"rows": [{"what", "bytes"}], "total_bytes"}
  [[nodiscard]] nlohmann::ordered_json json() const;

 private:
  std::vector<Row> rows_;
};

}  // namespace swiftlet
