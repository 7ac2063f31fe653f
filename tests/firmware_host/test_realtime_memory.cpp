// Memory before the flight: locked or the reason why not, touched, a heap that stays, and the table of it.

#include <malloc.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "firmware_host/realtime/memory_lock.hpp"
#include "tests/firmware_host/without_rights.hpp"
#include "tests/sanitized.hpp"
#include "tests/support/skip_case.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

using test::contains;

/// In KiB; what the kernel says of this process.
long lockedKib() {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("VmLck:")) return std::stol(line.substr(6));
  }
  return -1;
}

/// Runs `check` in a child, so that what it does to malloc or to limits ends with it; what it returned.
template <typename Check>
int inChild(Check&& check) {
  const pid_t child = fork();
  if (child == 0) _exit(check());
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::size_t residentPages(void* memory, std::size_t bytes) {
  std::vector<unsigned char> pages(bytes / static_cast<std::size_t>(sysconf(_SC_PAGESIZE)));
  mincore(memory, bytes, pages.data());
  return static_cast<std::size_t>(
      std::count_if(pages.begin(), pages.end(), [](unsigned char page) { return (page & 1U) != 0; }));
}

// Sanitizers turn mlockall off.
TEST_CASE("memory is locked, or the report says what is missing", "[unsanitized]") {
  const MemoryLockReport report = lockMemory();
  CHECK(report.mapped_bytes > 0);
  if (report.current) {
    CHECK(report.message.empty() == report.future);
    CHECK(lockedKib() > 0);
    unlockMemory();
    CHECK(lockedKib() == 0);
  } else {
    skipCase("this user may not lock memory: " + report.message, "sudo toolchain/test.sh");
    CHECK(contains(report.message, "ulimit -l"));
  }
  CHECK(toJson(report)["current"] == report.current);
}

TEST_CASE("without the right and beyond the limit nothing is locked, and the remedy is said",
          "[unsanitized]") {
  const WithoutRights guard;
  const int result = inChild([] {
    rlimit limit{};
    getrlimit(RLIMIT_MEMLOCK, &limit);
    constexpr rlim_t kLittle = 65'536;
    limit.rlim_cur = kLittle;
    setrlimit(RLIMIT_MEMLOCK, &limit);
    const MemoryLockReport report = lockMemory();
    if (report.current || report.future) return 1;
    if (report.limit_bytes != static_cast<std::int64_t>(kLittle)) return 2;
    if (!contains(report.message, "cap_ipc_lock") || !contains(report.message, "LimitMEMLOCK") ||
        !contains(report.message, "ulimit -l")) {
      return 3;
    }
    return lockedKib() == 0 ? 0 : 4;
  });
  CHECK(result == 0);
}

TEST_CASE("touching makes pages resident and keeps what they hold") {
  constexpr std::size_t kPages = 64;
  const std::size_t bytes = kPages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  REQUIRE(memory != MAP_FAILED);
  auto* text = static_cast<char*>(memory);
  std::strcpy(text + bytes - 100, "kept");
  CHECK(residentPages(memory, bytes) < kPages);
  // A range that begins and ends within pages reaches the pages at both ends.
  touchPages(text + 10, bytes - 20);
  CHECK(residentPages(memory, bytes) == kPages);
  CHECK(std::string(text + bytes - 100) == "kept");
  touchPages(text, 0);
  munmap(memory, bytes);
}

TEST_CASE("confined malloc in a fresh process", "[.][fresh_malloc]") {
  REQUIRE(confineMalloc().empty());
  constexpr std::size_t kReserve = std::size_t{32} * 1024 * 1024;
  reserveHeap(kReserve);
  const void* end = sbrk(0);
  const std::size_t arena = mallinfo2().arena;
  CHECK(arena >= kReserve);
  // A low-priority thread: images, vectors, strings, again and again.
  std::thread worker([] {
    for (int round = 0; round < 20; ++round) {
      std::vector<std::vector<char>> blocks;
      for (std::size_t i = 0; i < 30; ++i) blocks.emplace_back(10'000 + i * 20'000, 'x');
    }
  });
  worker.join();
  CHECK(sbrk(0) == end);              // the kernel was asked for nothing
  CHECK(mallinfo2().arena == arena);  // nothing given back, no second arena
  CHECK(mallinfo2().hblks == 0);      // no block with a mapping of its own
}

TEST_CASE("one arena for all threads, and a heap that is there in advance and stays", "[unsanitized]") {
  // An arena, once made for a thread, stays: only a process without threads so far shows it.
  const int result = inChild([] {
    execl("/proc/self/exe", "test_realtime", "[fresh_malloc]", static_cast<char*>(nullptr));
    return 1;
  });
  CHECK(result == 0);
}

TEST_CASE("libraries are held to one thread, and the report names them") {
  const LibraryReport report = confineLibraries();
  CHECK(report.libraries.size() >= 4);
  CHECK(report.threads >= 1);
  CHECK(!report.message.empty());
  for (const LibraryThreads& library : report.libraries) {
    CHECK(contains(report.message, library.library) == library.linked);
  }
  CHECK(std::string(std::getenv("OMP_NUM_THREADS")) == "1");
  CHECK(toJson(report)["threads"] == report.threads);
}

TEST_CASE("the memory table adds up, as text and as JSON") {
  MemoryTable table;
  CHECK(table.total() == 0);
  CHECK(contains(table.text(), "total"));
  table.add("image slots", 3 * 1024 * 1024);
  table.add("rings", 1024 * 1024);
  CHECK(table.total() == 4 * 1024 * 1024);
  const std::string text = table.text();
  CHECK(contains(text, "image slots"));
  CHECK(contains(text, "75.0 %"));
  CHECK(contains(text, "4.000 MiB"));
  CHECK(text.find("image slots") < text.find("rings"));
  CHECK(text.find("rings") < text.find("total"));
  const auto json = table.json();
  CHECK(json["rows"].size() == 2);
  CHECK(json["rows"][1]["what"] == "rings");
  CHECK(json["rows"][1]["bytes"] == 1024 * 1024);
  CHECK(json["total_bytes"] == table.total());
}

}  // namespace
}  // namespace swiftlet
