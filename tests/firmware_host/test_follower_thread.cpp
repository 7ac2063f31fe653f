// A follower that works, throws, and stands.

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <stdexcept>
#include <thread>

#include "drivers/device/monotonic_now.hpp"
#include "firmware_host/interfaces/follower_thread.hpp"

namespace swiftlet {
namespace {

ThreadSettings named(const char* name) {
  ThreadSettings settings;
  settings.name = name;
  return settings;
}

template <typename IsSo>
bool until(IsSo&& is_so) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!is_so() && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return is_so();
}

TEST_CASE("a follower beats at each turn and ends in order", "[follower]") {
  FollowerThread thread;
  thread.start(named("view"), "settings", "", [&] { thread.repeat(0.001, [](double) {}); });
  CHECK(until([&] { return thread.heart().read().turns > 5; }));
  CHECK(thread.heart().read().life == Life::kRunning);
  CHECK(thread.end(Duration::fromMilliseconds(20'000)));
  CHECK(thread.heart().read().life == Life::kEnded);
  CHECK(thread.fault().empty());
}

TEST_CASE("a follower's exception is seen while the run goes on, and kept", "[follower]") {
  FollowerThread thread;
  thread.start(named("dds"), "settings", "", [] { throw std::runtime_error("no memory"); });
  CHECK(until([&] { return thread.heart().read().life == Life::kFailed; }));
  CHECK(thread.heart().read().fault == "no memory");
  CHECK(thread.end(Duration::fromMilliseconds(20'000)));
  CHECK(thread.fault() == "no memory");
}

TEST_CASE("a follower that stands is left behind by name, within the time given", "[follower]") {
  static std::atomic<bool> go{false};
  static FollowerThread thread;  // whose memory stays
  thread.start(named("autopilot"), "settings", "", [] {
    thread.heart().doing("write");
    while (!go) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    thread.heart().beat();
  });
  CHECK(until([&] { return *thread.heart().read().doing != 0; }));
  const Stamp begin = monotonicNow();
  CHECK_FALSE(thread.end(Duration::fromMilliseconds(50)));
  CHECK(monotonicNow() - begin >= Duration::fromMilliseconds(50));
  CHECK_FALSE(thread.end());  // known: nobody waits again
  CHECK(thread.fault() == "thread autopilot did not end within 0.1 s and was abandoned, last seen at: write");
  // It goes on when it can, in memory that is still its own.
  go = true;
  CHECK(until([&] { return thread.heart().read().life == Life::kEnded; }));
}

}  // namespace
}  // namespace swiftlet
