#include <catch2/catch.hpp>

#include <cstdlib>

#include "firmware_host/outputs/ros2/ros_clock.hpp"

namespace swiftlet {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kOffset = 1'700'000'000 * kSecond;

HostClocks at(std::int64_t monotonic, std::int64_t ahead, std::int64_t error = 50) {
  return {{monotonic}, {ahead}, {error}};
}

TEST_CASE("a log's stamps go out as they are") {
  RosClock clock;
  CHECK(clock.toRos({77}) == Stamp{77});
  CHECK(clock.fromRos({77}) == Stamp{77});
}

TEST_CASE("readings that differ by their errors are no steps") {
  RosClock clock;
  for (int i = 0; i < 1000; ++i) {
    const std::int64_t error = 50 + i % 7 * 1000;
    clock.follow(at(i * (kSecond / 50), kOffset + (i % 2 == 0 ? error : -error), error));
    // The best of them holds.
    CHECK(std::abs(clock.toRos({5}).ns - 5 - kOffset) <= 50);
  }
  CHECK(clock.steps() == 0);
}

TEST_CASE("a step is followed at once and counted") {
  RosClock clock;
  clock.follow(at(0, 0));
  // NTP finds a network: from 1970 to today.
  clock.follow(at(kSecond / 50, kOffset));
  CHECK(clock.toRos({5}) == Stamp{5 + kOffset});
  CHECK(clock.steps() == 1);
  clock.follow(at(2 * (kSecond / 50), kOffset - 3'000'000));
  CHECK(clock.toRos({5}) == Stamp{5 + kOffset - 3'000'000});
  CHECK(clock.steps() == 2);
  // A reading that was held up for 5 ms says no more than its error.
  clock.follow(at(3 * (kSecond / 50), kOffset + 1'000'000, 5'000'000));
  CHECK(clock.steps() == 2);
}

TEST_CASE("an answer finds what was sent, whatever the clock did meanwhile") {
  RosClock clock;
  clock.follow(at(0, kOffset));
  const Stamp image{123'456'789};
  const Stamp sent = clock.toRosAndBack(image);
  CHECK(sent == Stamp{image.ns + kOffset});
  clock.follow(at(kSecond / 50, kOffset + 1000));
  CHECK(clock.fromRos(sent) == image);
  clock.follow(at(2 * (kSecond / 50), kOffset - 3600 * kSecond));
  CHECK(clock.fromRos(sent) == image);
  // Of others, by the clock as it is.
  CHECK(clock.fromRos({kOffset}) == Stamp{3600 * kSecond});
  // Older ones are forgotten.
  for (std::int64_t i = 0; i < 16; ++i) static_cast<void>(clock.toRosAndBack({i}));
  CHECK(clock.fromRos(sent) != image);
  CHECK(clock.fromRos(clock.toRos({0})) == Stamp{0});
}

TEST_CASE("the better of two readings is kept until the clock is stepped") {
  const HostClocks good = at(0, kOffset, 50);
  // Held up between its two calls; and one that is better.
  CHECK(betterOf(good, at(1, kOffset + 90, 100)).error == Duration{50});
  CHECK(betterOf(good, at(1, kOffset + 20, 30)).realtime_ahead == Duration{kOffset + 20});
  CHECK(betterOf(good, at(1, kOffset - 3'000'000, 100)).realtime_ahead == Duration{kOffset - 3'000'000});
}

TEST_CASE("this machine's clocks") {
  RosClock clock;
  const HostClocks now = readHostClocks();
  CHECK(now.error.ns > 0);
  clock.follow(now);
  timespec wall{};
  clock_gettime(CLOCK_REALTIME, &wall);
  const std::int64_t later = clock.toRos(monotonicNow()).ns - (wall.tv_sec * kSecond + wall.tv_nsec);
  // A loaded machine may stop between two readings.
  CHECK(std::abs(later) < kSecond);
}

}  // namespace
}  // namespace swiftlet
