// A terminal never decides a run: the program itself, with stdout and stderr that are closed, broken, full or
// hung up, ends as it does with a good one, and its files are complete.

#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

#include "firmware_host/commands/stop_signal.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/stage_timer.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

const std::string kLog = SWIFTLET_TEST_DATA "/euroc_mh01_4s";
/// A run of two seconds takes no longer on any machine; one that stands still does.
constexpr double kLongestRun = 60;  // s

/// Of waitpid; -1: had to be killed.
int waitFor(pid_t child) {
  const double begin = wallSeconds();
  int status = 0;
  while (waitpid(child, &status, WNOHANG) == 0) {
    if (wallSeconds() - begin > kLongestRun) {
      kill(child, SIGKILL);
      waitpid(child, &status, 0);
      return -1;
    }
    ::poll(nullptr, 0, 10);
  }
  return status;
}

/// What becomes of a process that does `work`.
int statusOf(const std::function<void()>& work) {
  const pid_t child = fork();
  if (child == 0) {
    work();
    _exit(0);
  }
  return waitFor(child);
}

/// Replays the short log in real time, with the standard streams that `prepare` makes in the new process.
int replay(const std::string& out, const std::function<void()>& prepare) {
  return statusOf([&] {
    std::signal(SIGPIPE, SIG_DFL);
    prepare();
    execl(SWIFTLET_PROGRAM, "swiftlet", "replay", kLog.c_str(), "--real-time", "--speed", "2", "--record",
          "--out", out.c_str(), static_cast<char*>(nullptr));
    _exit(127);
  });
}

void useFor(int file, std::initializer_list<int> streams) {
  for (const int stream : streams) dup2(file, stream);
}

std::size_t linesOf(const std::string& name) {
  std::ifstream file(name);
  return static_cast<std::size_t>(
      std::count(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>(), '\n'));
}

void checkComplete(const std::string& run) {
  std::ifstream file(run + "/summary.json");
  const auto summary = nlohmann::json::parse(file, nullptr, false);
  REQUIRE_FALSE(summary.is_discarded());
  CHECK(summary.at("executor").at("thread_faults").empty());
  const std::size_t poses = summary.at("counters").at("odometry").at("poses");
  CHECK(poses > 20);
  CHECK(linesOf(run + "/odometry.tum") == poses);
  CHECK(linesOf(run + "/states.csv") > 1);
  // What a message would look like in a file that has a standard stream's number.
  for (const char* name : {"/odometry.tum", "/states.csv", "/events.log"}) {
    const std::string all = test::textOf(run + name);
    CHECK(all.find("reserved memory") == std::string::npos);
    CHECK(all.find("written to") == std::string::npos);
  }
  CHECK(std::filesystem::exists(run + "/recording"));
}

/// A pipe of which nobody reads what it is full of.
std::array<int, 2> fullPipe() {
  std::array<int, 2> ends{};
  REQUIRE(pipe(ends.data()) == 0);
  fcntl(ends[1], F_SETFL, O_NONBLOCK);
  const std::string block(4096, 'x');
  while (write(ends[1], block.data(), block.size()) > 0) {
  }
  fcntl(ends[1], F_SETFL, 0);
  return ends;
}

TEST_CASE("a run with closed standard streams is complete") {
  const ScratchFolder folder("terminal_closed");
  const std::string run = folder.file("run");
  CHECK(replay(run, [] {
          for (const int stream : {0, 1, 2}) close(stream);
        }) == 0);
  checkComplete(run);
}

TEST_CASE("a run whose reader has gone is complete") {
  const ScratchFolder folder("terminal_broken");
  const std::string run = folder.file("run");
  std::array<int, 2> ends{};
  REQUIRE(pipe(ends.data()) == 0);
  close(ends[0]);
  CHECK(replay(run, [&] { useFor(ends[1], {1, 2}); }) == 0);
  checkComplete(run);
  close(ends[1]);
}

TEST_CASE("a run whose reader stands still is complete") {
  const ScratchFolder folder("terminal_full");
  const std::string run = folder.file("run");
  const auto ends = fullPipe();
  CHECK(replay(run, [&] { useFor(ends[1], {1, 2}); }) == 0);
  checkComplete(run);
  close(ends[0]);
  close(ends[1]);
}

TEST_CASE("a run whose messages find no room on the disk is complete") {
  const ScratchFolder folder("terminal_enospc");
  const std::string run = folder.file("run");
  CHECK(replay(run, [] { useFor(open("/dev/full", O_WRONLY), {1, 2}); }) == 0);
  checkComplete(run);
}

TEST_CASE("a run whose terminal has hung up is complete") {
  const ScratchFolder folder("terminal_hung_up");
  const std::string run = folder.file("run");
  CHECK(replay(run, [] {
          setsid();
          std::signal(SIGHUP, SIG_IGN);  // as nohup does
          const int master = posix_openpt(O_RDWR | O_NOCTTY);
          if (grantpt(master) != 0 || unlockpt(master) != 0) _exit(98);
          useFor(open(ptsname(master), O_RDWR), {0, 1, 2});
          close(master);
        }) == 0);
  checkComplete(run);
}

TEST_CASE("a hang-up ends a program at a terminal, and is noted by a flight") {
  const int ended = statusOf([] {
    stopOnSignal();
    raise(SIGHUP);
  });
  CHECK(WIFSIGNALED(ended));
  CHECK(WTERMSIG(ended) == SIGHUP);
  CHECK(statusOf([] {
          const std::atomic<bool>& hung_up = surviveHangUp();
          if (hung_up) _exit(1);
          raise(SIGHUP);
          _exit(hung_up ? 0 : 2);
        }) == 0);
}

TEST_CASE("a program started with hang-ups ignored is not told of them") {
  CHECK(statusOf([] {
          std::signal(SIGHUP, SIG_IGN);
          const std::atomic<bool>& hung_up = surviveHangUp();
          raise(SIGHUP);
          _exit(hung_up ? 1 : 0);
        }) == 0);
}

TEST_CASE("messages wait for a reader that stands still once, and go out again when it reads") {
  CHECK(statusOf([] {
          const auto ends = fullPipe();
          useFor(ends[1], {2});
          const double begin = wallSeconds();
          for (int i = 0; i < 1000; ++i) warn("a message that nobody reads\n");
          // 100 s if each of them waited.
          if (wallSeconds() - begin > 20) _exit(1);
          std::string text(std::size_t{1} << 20U, '\0');
          if (read(ends[0], text.data(), text.size()) <= 0) _exit(2);
          const std::string longer(3000, 'y');
          warn(longer + "\n");
          const ssize_t got = read(ends[0], text.data(), text.size());
          text.resize(static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
          if (text.find(longer + "\n") == std::string::npos) _exit(3);
        }) == 0);
}

}  // namespace
}  // namespace swiftlet
