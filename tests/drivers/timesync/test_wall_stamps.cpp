// Stamps of the wall clock on the steady one, through steps of the wall clock, for drivers that follow it and
// for those that do not.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <cstdlib>
#include <functional>

#include "drivers/timesync/wall_stamps.hpp"
#include "estimator/core/random.hpp"
#include "tests/drivers/timesync/units.hpp"

namespace swiftlet {
namespace {

using test::kMs;

constexpr std::int64_t kAhead = 1'700'000'000'000'000'000;  // ns, of the wall clock at the start
constexpr std::int64_t kPeriod = 5 * kMs;
constexpr Duration kReadingError{200};

struct Outcome {
  std::uint64_t mapped = 0, unsure = 0, wrong_clock = 0;
  std::int64_t worst = 0;  ///< ns, of mapped stamps
  std::uint64_t steps = 0, followed = 0;
};

/// A sensor at 200 Hz for 12 s, whose messages take `delay(n)`; the wall clock is set by `step` after 4 s.
/// `follows`: its driver reads the wall clock for each stamp, at the capture.
Outcome run(std::int64_t step, bool follows, const std::function<std::int64_t(int)>& delay) {
  WallStamps stamps;
  Outcome outcome;
  const std::int64_t when = 4'000 * kMs;
  for (int n = 0; n < 2400; ++n) {
    const std::int64_t capture = n * kPeriod;
    const std::int64_t arrival = capture + delay(n);
    const std::int64_t wall = capture + kAhead + (follows && capture >= when ? step : 0);
    const std::int64_t ahead = kAhead + (arrival >= when ? step : 0);
    static_cast<void>(stamps.follow({{arrival}, {ahead}, kReadingError}));
    Stamp host;
    switch (stamps.map({wall}, {arrival}, host)) {
      case WallStamps::Result::kMapped:
        ++outcome.mapped;
        outcome.worst = std::max(outcome.worst, std::abs(host.ns - capture));
        break;
      case WallStamps::Result::kUnsure:
        ++outcome.unsure;
        break;
      case WallStamps::Result::kWrongClock:
        ++outcome.wrong_clock;
    }
  }
  outcome.steps = stamps.steps();
  outcome.followed = stamps.followed();
  return outcome;
}

TEST_CASE("steps of the wall clock are followed by the stamps that follow them, and by no others") {
  const std::int64_t step =
      GENERATE(-3'600'000, -5'000, -400, -100, -30, 30, 100, 400, 5'000, 3'600'000) * kMs;
  const bool follows = GENERATE(false, true);
  Random random(7);
  // Up to 4 ms of jitter; a message in 50 is 30 ms late.
  const Outcome outcome = run(step, follows, [&](int n) {
    return 3 * kMs + static_cast<std::int64_t>(random.uniform() * 4 * kMs) + (n % 50 == 25 ? 30 * kMs : 0);
  });
  CAPTURE(step / kMs, follows, outcome.mapped, outcome.unsure);
  CHECK(outcome.steps == 1);
  CHECK(outcome.followed % 2 == (follows ? 1 : 0));
  CHECK(outcome.wrong_clock == 0);
  CHECK(outcome.worst == 0);
  // For two seconds a late message may be one of a step of its size.
  CHECK(outcome.unsure <= 8);
}

TEST_CASE("stamps of another clock are refused, whatever it is") {
  // A stamp ahead of its arrival cannot be late.
  for (const double off : {-1e9, -3600.0, -1.1, 0.07, 0.9, 1.1, 5.0, 1e9}) {
    WallStamps stamps;
    static_cast<void>(stamps.follow({{0}, {kAhead}, kReadingError}));
    Stamp host{-1};
    const Stamp wall{kAhead + static_cast<std::int64_t>(off * 1e9)};
    CHECK(stamps.map(wall, {10 * kMs}, host) == WallStamps::Result::kWrongClock);
    CHECK(host.ns == -1);
    CHECK(stamps.farBy().seconds() == Approx(0.01 - off));
  }
}

TEST_CASE("a driver that starts anew after a step is found again") {
  // Not following at first, silent for 3 s, and by the wall clock as it is from then on.
  WallStamps stamps;
  const std::int64_t step = 700 * kMs;
  std::uint64_t wrong = 0, mapped = 0;
  for (int n = 0; n < 2400; ++n) {
    const std::int64_t capture = n * kPeriod;
    if (capture >= 8'000 * kMs && capture < 11'000 * kMs) continue;
    const std::int64_t arrival = capture + 2 * kMs;
    const std::int64_t wall = capture + kAhead + (capture >= 11'000 * kMs ? step : 0);
    static_cast<void>(
        stamps.follow({{arrival}, {kAhead + (arrival >= 4'000 * kMs ? step : 0)}, kReadingError}));
    Stamp host;
    if (stamps.map({wall}, {arrival}, host) != WallStamps::Result::kMapped) continue;
    ++mapped;
    wrong += host.ns == capture ? 0 : 1;
  }
  CHECK(wrong == 0);
  CHECK(mapped == 1800);
}

TEST_CASE("readings of the clocks that are disturbed are no steps") {
  WallStamps stamps;
  Random random(3);
  for (int n = 0; n < 10'000; ++n) {
    const auto error = static_cast<std::int64_t>(random.uniform() * 3 * static_cast<double>(kMs));
    const auto off = static_cast<std::int64_t>((2 * random.uniform() - 1) * static_cast<double>(error));
    CHECK_FALSE(stamps.follow({{n * kPeriod}, {kAhead + off}, {error + 1}}));
    Stamp host;
    REQUIRE(stamps.map({kAhead + n * kPeriod}, {n * kPeriod + kMs}, host) == WallStamps::Result::kMapped);
    CHECK(std::abs(host.ns - n * kPeriod) <= 3 * kMs);
  }
  CHECK(stamps.steps() == 0);
}

}  // namespace
}  // namespace swiftlet
