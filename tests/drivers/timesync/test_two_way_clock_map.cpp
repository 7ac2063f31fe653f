#include <catch2/catch.hpp>

#include <array>

#include "tests/drivers/timesync/clock_errors.hpp"

namespace swiftlet {
namespace {

using test::Jitter;
using test::LinkSettings;

constexpr double kTwoWayLimit = 0.2;  // ms beyond half the asymmetry
constexpr int kTwoWaySeeds = 8;

TEST_CASE("Two-way map: beyond half the asymmetry", "[timesync]") {
  for (const Jitter jitter : {Jitter::kUniform, Jitter::kExponential}) {
    for (const double skew : {100.0, -100.0}) {
      for (const double step_every : {0.0, 37.0}) {
        LinkSettings link;
        link.jitter = jitter;
        link.skew_ppm = skew;
        link.step_every = step_every;
        link.seconds = step_every > 0 ? 200 : 60;
        test::ClockErrors errors;
        for (std::uint64_t seed = 1; seed <= kTwoWaySeeds; ++seed) {
          test::runTwoWay(link, 1, seed, errors);
          CHECK(errors.locked_share > 0.99);
          CHECK(errors.status.skew_ppm == Approx(skew).margin(8));
          // The constant delays: 3 ms and 1 ms.
          CHECK(errors.status.error_bound.seconds() == Approx(2e-3).margin(2e-4));
        }
        CHECK(test::quantile(errors.settled, 0.99) < kTwoWayLimit);
        CHECK(errors.beyond_bound == 0);
      }
    }
  }
}

TEST_CASE("Two-way map: far better than the filter of round trips at TIMESYNC's 10 Hz", "[timesync]") {
  LinkSettings link;
  link.rate = 10;
  test::ClockErrors errors;
  std::vector<double> filter;
  for (std::uint64_t seed = 1; seed <= kTwoWaySeeds; ++seed) {
    test::runTwoWay(link, 1, seed, errors);
    const auto some = test::runRoundTripFilter(link, 1, seed);
    filter.insert(filter.end(), some.begin(), some.end());
  }
  CHECK(4 * test::quantile(errors.settled, 0.99) < test::quantile(filter, 0.99));
}

TEST_CASE("Two-way map: what is no exchange is refused, one odd answer shifts nothing", "[timesync]") {
  TwoWayClockMap map;
  CHECK(!map.toHost({0}).has_value());
  CHECK(!map.add({{10}, {5}, {9}}).ok());
  std::int64_t own = 1'000'000'000'000;
  const auto ask = [&](std::int64_t remote_off) {
    own += 20'000'000;
    return map.add({{own}, {own - 7'000'000'000 + remote_off}, {own + 2'000'000}});
  };
  for (int i = 0; i < 1000; ++i) REQUIRE(ask(1'000'000).ok());
  CHECK(map.lock() == LockState::kLocked);
  CHECK(map.toHost({own - 7'000'000'000})->ns == Approx(own).margin(1000));
  CHECK(!ask(900'000'000).ok());
  CHECK(!ask(-900'000'000).ok());
  REQUIRE(ask(1'000'000).ok());
  CHECK(map.status().resets == 0);
  for (int i = 0; i < 3; ++i) (void)ask(900'000'000);
  CHECK(map.status().resets == 1);
  CHECK(map.toHost({own - 7'000'000'000 + 900'000'000})->ns == Approx(own + 1'000'000).margin(1000));
}

TEST_CASE("Two-way map takes any stamps without overflow", "[timesync]") {
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  constexpr std::int64_t kLeast = std::numeric_limits<std::int64_t>::min();
  const std::array<std::int64_t, 8> edges = {0,         1, kMost, kLeast, kStampLimit - 1, 1 - kStampLimit,
                                             1LL << 53, -1};
  std::size_t used = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    Random random(seed);
    TwoWayClockMap map;
    std::array<std::int64_t, 3> t{};
    for (int i = 0; i < 500; ++i) {
      if (random.below(4) == 0) t[random.below(3)] = edges[random.below(edges.size())];
      if (withinLimit({t[0]}) && withinLimit({t[1]})) {
        const std::int64_t step = 1LL << random.below(50);
        t[0] += step;
        t[1] += step;
        t[2] = t[0] + random.below(1000);
      }
      if (map.add({{t[0]}, {t[1]}, {t[2]}}).ok()) ++used;
      (void)map.toHost({edges[random.below(edges.size())]});
      (void)map.status();
    }
  }
  CHECK(used > 1000);
}

}  // namespace
}  // namespace swiftlet
