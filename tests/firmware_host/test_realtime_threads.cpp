// Flight threads: name, priority, CPU and stack as wanted where the right is there, and a value that says
// what is missing where it is not.

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "firmware_host/realtime/flight_thread.hpp"
#include "tests/firmware_host/without_rights.hpp"
#include "tests/support/skip_case.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

using test::contains;

constexpr std::size_t kStack = std::size_t{1024} * 1024;

int aCpuOfOurs() {
  cpu_set_t set;
  CPU_ZERO(&set);
  pthread_getaffinity_np(pthread_self(), sizeof set, &set);
  int last = -1;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &set)) last = cpu;
  }
  return last;
}

/// Every page of the calling thread's stack is resident.
bool stackIsResident() {
  pthread_attr_t attributes;
  pthread_getattr_np(pthread_self(), &attributes);
  void* low = nullptr;
  std::size_t bytes = 0;
  pthread_attr_getstack(&attributes, &low, &bytes);
  pthread_attr_destroy(&attributes);
  std::vector<unsigned char> pages(bytes / static_cast<std::size_t>(sysconf(_SC_PAGESIZE)));
  if (pages.size() < kStack / static_cast<std::size_t>(sysconf(_SC_PAGESIZE))) return false;
  if (mincore(low, bytes, pages.data()) != 0) return false;
  return std::all_of(pages.begin(), pages.end(), [](unsigned char page) { return (page & 1U) != 0; });
}

TEST_CASE("a thread has its name, its CPU and a stack that is there before it begins") {
  const int cpu = aCpuOfOurs();
  std::string name(16, '\0');
  int ran_on = -1;
  bool resident = false;
  FlightThread thread;
  const ThreadReport report = thread.start({"a_name_of_more_than_15", 0, cpu, kStack}, [&] {
    resident = stackIsResident();
    pthread_getname_np(pthread_self(), name.data(), name.size());
    ran_on = sched_getcpu();
  });
  thread.join();
  CHECK(report.started);
  CHECK(report.hasPriority());
  CHECK(report.message.empty());
  CHECK(report.name == "a_name_of_more_");
  CHECK(name.c_str() == report.name);
  CHECK(report.actual_cpus == std::vector<int>{cpu});
  CHECK(ran_on == cpu);
  CHECK(resident);
  CHECK(report.stack_bytes == kStack);
  CHECK(thread.fault().empty());
  CHECK(!thread.joinable());
}

TEST_CASE("a real-time priority is had, or its absence said with the remedy") {
  int policy = -1;
  sched_param priority{};
  FlightThread thread;
  const ThreadReport report = thread.start(
      {"track", 40, -1, kStack}, [&] { pthread_getschedparam(pthread_self(), &policy, &priority); });
  thread.join();
  CHECK(report.wanted_policy == ThreadPolicy::kFifo);
  CHECK(report.wanted_priority == 40);
  if (report.message.empty()) {
    CHECK(report.hasPriority());
    CHECK(policy == SCHED_FIFO);
    CHECK(priority.sched_priority == 40);
    CHECK(describe(report).find("SCHED_FIFO 40") != std::string::npos);
  } else {
    skipCase("this user may not use SCHED_FIFO: " + std::string(report.message), "sudo toolchain/test.sh");
    CHECK(!report.hasPriority());
  }
}

TEST_CASE("without the right a thread runs all the same and says what is missing") {
  const WithoutRights guard;
  bool ran = false;
  int policy = -1;
  FlightThread thread;
  const ThreadReport report = thread.start({"smooth", 30, aCpuOfOurs(), kStack}, [&] {
    ran = true;
    sched_param priority{};
    pthread_getschedparam(pthread_self(), &policy, &priority);
  });
  thread.join();
  CHECK(ran);
  CHECK(report.started);
  CHECK(!report.hasPriority());
  CHECK(policy == SCHED_OTHER);
  CHECK(report.actual_policy == ThreadPolicy::kOther);
  CHECK(report.actual_priority == 0);
  // The CPU needs no right and is not given up with the priority.
  CHECK(report.actual_cpus == std::vector<int>{aCpuOfOurs()});
  CHECK(contains(report.message, "SCHED_FIFO 30"));
  CHECK(contains(report.message, "cap_sys_nice"));
  CHECK(contains(report.message, "LimitRTPRIO"));
  CHECK(contains(report.message, "ulimit -r"));
  CHECK(contains(describe(report), "SCHED_OTHER"));
  const auto json = toJson(report);
  CHECK(json["wanted_policy"] == "SCHED_FIFO");
  CHECK(json["policy"] == "SCHED_OTHER");
  CHECK(json["message"] == report.message);
}

TEST_CASE("a CPU that is not there is given up, and said") {
  for (const int cpu : {CPU_SETSIZE - 1, CPU_SETSIZE + 3}) {
    bool ran = false;
    FlightThread thread;
    const ThreadReport report = thread.start({"mesh", 0, cpu, kStack}, [&] { ran = true; });
    thread.join();
    CHECK(ran);
    CHECK(report.hasPriority());
    CHECK(contains(report.message, std::to_string(cpu)));
    CHECK(!report.actual_cpus.empty());
  }
}

TEST_CASE("a missing right and a missing CPU are both said, each once") {
  const WithoutRights guard;
  FlightThread thread;
  const ThreadReport report = thread.start({"both", 10, CPU_SETSIZE - 1, kStack}, [] {});
  thread.join();
  CHECK(report.started);
  CHECK(contains(report.message, "SCHED_FIFO 10"));
  const std::size_t first = report.message.find("CPU 1023");
  CHECK(first != std::string::npos);
  CHECK(report.message.find("CPU 1023", first + 1) == std::string::npos);
}

TEST_CASE("what cannot be made is said and leaves nothing behind") {
  FlightThread thread;
  CHECK(!thread.start({"x", 100, -1, kStack}, [] {}).started);
  CHECK(!thread.start({"x", -1, -1, kStack}, [] {}).started);
  const ThreadReport huge = thread.start({"x", 0, -1, std::size_t{1} << 46U}, [] {});
  CHECK(!huge.started);
  CHECK(!huge.hasPriority());
  CHECK(contains(huge.message, "stack"));
  CHECK(!thread.joinable());
  thread.join();
  CHECK(thread.start({"x", 0, -1, kStack}, [] {}).started);
}

TEST_CASE("no exception crosses the thread") {
  FlightThread thread;
  REQUIRE(thread.start({"throws", 0, -1, kStack}, [] { throw std::runtime_error("broken input"); }).started);
  thread.join();
  CHECK(thread.fault() == "broken input");
  REQUIRE(thread.start({"throws", 0, -1, kStack}, [] { throw 5; }).started);
  thread.join();
  CHECK(!thread.fault().empty());
  REQUIRE(thread.start({"returns", 0, -1, kStack}, [] {}).started);
  thread.join();
  CHECK(thread.fault().empty());
}

TEST_CASE("a thread that does not end is given up, and may end later") {
  // Not of this function: the thread outlives it.
  static std::atomic<bool> go{false}, gone{false};
  {
    FlightThread thread;
    CHECK(thread.joinWithin(Duration{}));
    REQUIRE(thread
                .start({"stuck", 0, -1, kStack},
                       [] {
                         while (!go) std::this_thread::sleep_for(std::chrono::milliseconds(1));
                         gone = true;
                       })
                .started);
    CHECK_FALSE(thread.joinWithin(Duration::fromMilliseconds(20)));
    CHECK(thread.joinable());
    thread.abandon();
    CHECK_FALSE(thread.joinable());
    // Free for another.
    REQUIRE(thread.start({"next", 0, -1, kStack}, [] {}).started);
    CHECK(thread.joinWithin(Duration::fromMilliseconds(20'000)));
  }
  go = true;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!gone && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  CHECK(gone);
}

TEST_CASE("a thread is started once at a time") {
  FlightThread thread;
  REQUIRE(thread.start({"first", 0, -1, kStack}, [] {}).started);
  const ThreadReport second = thread.start({"second", 0, -1, kStack}, [] { FAIL("ran"); });
  CHECK(!second.started);
  CHECK(contains(second.message, "join"));
}

TEST_CASE("a thread's page faults are counted, while it hangs and after its end") {
  constexpr std::size_t kPages = 50;
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  void* const memory =
      mmap(nullptr, kPages * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  REQUIRE(memory != MAP_FAILED);
  // Else one fault may bring all of it.
  madvise(memory, kPages * page, MADV_NOHUGEPAGE);
  std::atomic<bool> touched{false}, end{false};
  FlightThread thread;
  CHECK(thread.pageFaults().minor == 0);
  const ThreadReport report = thread.start({"faulty", 0, -1, kStack}, [&] {
    for (std::size_t i = 0; i < kPages; ++i) static_cast<volatile char*>(memory)[i * page] = 1;
    touched = true;
    touched.notify_one();
    end.wait(false);
  });
  REQUIRE(report.started);
  touched.wait(false);
  const PageFaults hanging = thread.pageFaults();
  CHECK(hanging.minor >= kPages);
  end = true;
  end.notify_one();
  thread.join();
  CHECK(thread.pageFaults().minor >= hanging.minor);
  CHECK(thread.pageFaults().minor < hanging.minor + kPages);
  // Another entry counts anew.
  REQUIRE(thread.start({"sound", 0, -1, kStack}, [] {}).started);
  thread.join();
  CHECK(thread.pageFaults().minor < kPages);
  munmap(memory, kPages * page);
}

std::atomic<int> begins{0}, ends{0};

TEST_CASE("a test sees every thread begin and end") {
  FlightThread::watchAll([](const char* thread, bool begin) {
    if (std::strcmp(thread, "watched") == 0) ++(begin ? begins : ends);
  });
  FlightThread thread;
  REQUIRE(thread.start({"watched", 0, -1, kStack}, [] { throw std::runtime_error("it ends"); }).started);
  thread.join();
  CHECK(begins == 1);
  CHECK(ends == 1);
  FlightThread::watchAll(nullptr);
  REQUIRE(thread.start({"watched", 0, -1, kStack}, [] {}).started);
  thread.join();
  CHECK(begins == 1);
}

}  // namespace
}  // namespace swiftlet
