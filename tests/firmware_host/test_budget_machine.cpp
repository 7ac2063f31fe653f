// The bare timer loop and the load generator: what they measure and make is real, and nothing stays behind.

#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "firmware_host/lab/budget/bare_timer_loop.hpp"
#include "firmware_host/lab/budget/load_generator.hpp"

namespace {

std::atomic<long> allocations{0};

}  // namespace

// Counts every allocation of the program.
void* operator new(std::size_t bytes) {
  ++allocations;
  if (void* memory = std::malloc(bytes)) return memory;
  throw std::bad_alloc();
}
void* operator new(std::size_t bytes, const std::nothrow_t&) noexcept {
  ++allocations;
  return std::malloc(bytes);
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace swiftlet {
namespace {

using namespace std::chrono_literals;

TEST_CASE("the bare timer loop wakes at its period, notes each lateness and allocates nothing") {
  BareTimerLoop loop;
  const ThreadReport report = loop.start({"bare timer", 30, -1});
  REQUIRE(report.started);
  std::this_thread::sleep_for(20ms);
  const long before = allocations;
  std::this_thread::sleep_for(300ms);
  CHECK(allocations == before);
  loop.stop();
  const std::uint64_t periods = loop.lateness().count() + loop.skipped();
  CHECK(loop.lateness().count() > 0);
  // 320 ms of 1 ms periods, were the machine never late; each one counts once.
  CHECK(periods >= 300);
  CHECK(periods < 5000);
  CHECK(loop.lateness().max() >= 0);
  CHECK(loop.lateness().percentile(0.5) < 0.1);
}

TEST_CASE("a loop begins anew, is started once at a time and may be stopped twice") {
  BareTimerLoop loop;
  loop.stop();
  REQUIRE(loop.start({"bare", 0, -1}, Duration::fromMilliseconds(2)).started);
  std::this_thread::sleep_for(50ms);
  CHECK(!loop.start({"bare", 0, -1}).started);
  loop.stop();
  loop.stop();
  const std::uint64_t first = loop.lateness().count() + loop.skipped();
  CHECK(first >= 10);
  REQUIRE(loop.start({"bare", 0, -1}, Duration::fromMilliseconds(10)).started);
  loop.stop();
  CHECK(loop.lateness().count() < first);
}

double secondsOf(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

TEST_CASE("load burns CPU time and memory while it runs, and is gone when it is stopped") {
  rusage before{};
  getrusage(RUSAGE_CHILDREN, &before);
  LoadGenerator load;
  CHECK(load.running() == 0);
  CHECK(load.start({1, 1, std::size_t{8} * 1024 * 1024}).empty());
  CHECK(load.workers().size() == 2);
  std::this_thread::sleep_for(300ms);
  CHECK(load.running() == 2);
  const std::vector<pid_t> workers = load.workers();
  load.stop();
  CHECK(load.running() == 0);
  for (const pid_t worker : workers) {
    CHECK(kill(worker, 0) == -1);
    CHECK(errno == ESRCH);
  }
  rusage after{};
  getrusage(RUSAGE_CHILDREN, &after);
  CHECK(secondsOf(after.ru_utime) - secondsOf(before.ru_utime) > 0.02);
  CHECK(after.ru_maxrss > 6 * 1024);                 // KiB: the block was filled
  CHECK(after.ru_minflt - before.ru_minflt > 2000);  // and mapped anew
  load.stop();
}

TEST_CASE("a worker that was killed is seen, and does not hinder the end") {
  LoadGenerator load;
  REQUIRE(load.start({2, 0}).empty());
  kill(load.workers()[0], SIGKILL);
  for (int i = 0; i < 500 && load.running() == 2; ++i) std::this_thread::sleep_for(10ms);
  CHECK(load.running() == 1);
  // Ctrl-C at the terminal is the parent's affair.
  kill(load.workers()[1], SIGINT);
  std::this_thread::sleep_for(20ms);
  CHECK(load.running() == 1);
  load.stop();
  CHECK(load.workers().empty());
}

TEST_CASE("load dies with its parent, even when that is killed") {
  // Orphans come to this process, so that it can see them end.
  REQUIRE(prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0) == 0);
  int ends[2];
  REQUIRE(pipe(ends) == 0);
  const pid_t parent = fork();
  if (parent == 0) {
    LoadGenerator load;
    load.start({1, 0});
    const pid_t worker = load.workers().empty() ? 0 : load.workers()[0];
    const bool told = write(ends[1], &worker, sizeof worker) == static_cast<ssize_t>(sizeof worker);
    if (told) pause();
    _exit(1);
  }
  pid_t worker = 0;
  REQUIRE(read(ends[0], &worker, sizeof worker) == static_cast<ssize_t>(sizeof worker));
  REQUIRE(worker > 0);
  // The name comes last in what a worker does before its work.
  bool at_work = false;
  for (int i = 0; i < 500 && !at_work; ++i) {
    std::string name;
    std::getline(std::ifstream("/proc/" + std::to_string(worker) + "/comm"), name);
    at_work = name == "swiftlet-load";
    if (!at_work) std::this_thread::sleep_for(10ms);
  }
  CHECK(at_work);
  kill(parent, SIGKILL);
  waitpid(parent, nullptr, 0);
  int status = 0;
  pid_t ended = 0;
  for (int i = 0; i < 500 && ended != worker; ++i) {
    ended = waitpid(worker, &status, WNOHANG);
    if (ended != worker) std::this_thread::sleep_for(10ms);
  }
  CHECK(ended == worker);
  CHECK(WIFSIGNALED(status));
  CHECK(WTERMSIG(status) == SIGKILL);
  if (ended != worker) kill(worker, SIGKILL);
  prctl(PR_SET_CHILD_SUBREAPER, 0, 0, 0, 0);
  close(ends[0]);
  close(ends[1]);
}

}  // namespace
}  // namespace swiftlet
