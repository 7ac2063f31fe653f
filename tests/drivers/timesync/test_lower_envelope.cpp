#include <catch2/catch.hpp>

#include <algorithm>
#include <limits>
#include <vector>

#include "drivers/timesync/delay_histogram.hpp"
#include "drivers/timesync/lower_envelope.hpp"
#include "drivers/timesync/rising_stamps.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

struct Point {
  double time, value;
};

/// Smallest sum of distances of any line under all points through two of them.
double bestSum(const std::vector<Point>& points) {
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t k = i + 1; k < points.size(); ++k) {
      const double slope = (points[k].value - points[i].value) / (points[k].time - points[i].time);
      double sum = 0;
      bool below = true;
      for (const Point& p : points) {
        const double height = p.value - points[i].value - slope * (p.time - points[i].time);
        below = below && height > -1e-3;
        sum += height;
      }
      if (below) best = std::min(best, sum);
    }
  }
  return best;
}

TEST_CASE("The line under the points is the one with the smallest sum of distances", "[timesync]") {
  Random random(3);
  for (int run = 0; run < 50; ++run) {
    LowerEnvelope envelope;
    std::vector<Point> points;
    for (int i = 0; i < 60; ++i) {
      const Stamp time = {1'000'000'000 + i * LowerEnvelope::kBinWidth.ns};
      const auto value = static_cast<std::int64_t>(7e9 + 90.0 * i + random.uniform(0, 4e5));
      envelope.add(time, value);
      points.push_back({static_cast<double>(time.ns), static_cast<double>(value)});
    }
    double sum = 0;
    for (const Point& p : points) {
      const double height =
          envelope.heightOf({static_cast<std::int64_t>(p.time)}, static_cast<std::int64_t>(p.value));
      REQUIRE(height > -1e-3);
      sum += height;
    }
    CHECK(sum == Approx(bestSum(points)).epsilon(1e-9));
  }
}

TEST_CASE("The envelope keeps a window, and its slope through a restart", "[timesync]") {
  LowerEnvelope envelope;
  for (int i = 0; i < 400; ++i) {
    envelope.add({i * LowerEnvelope::kBinWidth.ns}, 100LL * i * 250);  // 100 ppm
  }
  CHECK(envelope.bins() == LowerEnvelope::kBins);
  CHECK(envelope.slope() == Approx(100e-6));
  envelope.restart();
  CHECK(envelope.empty());
  envelope.add({0}, 5);
  CHECK(envelope.at({1'000'000'000}) == 5 + 100'000);
}

TEST_CASE("A slope beyond crystals' is taken from points on a line, not from a step", "[timesync]") {
  for (const double slope : {3e-3, -3e-3}) {
    for (int step_at = 1; step_at <= 20; ++step_at) {
      Random random(1);
      LowerEnvelope line;
      LowerEnvelope step;
      for (int i = 0; i < 100; ++i) {
        const Stamp time = {i * LowerEnvelope::kBinWidth.ns};
        const double jitter = random.uniform(0, 2e5);
        line.add(time, static_cast<std::int64_t>(slope * static_cast<double>(time.ns) + jitter));
        // By as much as the line rises in 2 s.
        step.add(time, static_cast<std::int64_t>((i < step_at ? 0 : slope * 2e9) + jitter));
        if (i > 20) CHECK(line.slope() == Approx(slope).epsilon(0.05));
        INFO("step at " << step_at << ", point " << i);
        CHECK(std::abs(step.slope()) < 151e-6);
      }
    }
  }
}

TEST_CASE("The lowest point of each quarter second counts, not the first", "[timesync]") {
  LowerEnvelope envelope;
  for (int i = 0; i < 1000; ++i) envelope.add({i * 10'000'000LL}, i % 25 == 13 ? 700 : 100'000 + i % 7);
  CHECK(envelope.at({10'000'000'000}) == 700);
}

TEST_CASE("A delay that has risen for good is told from one that has not", "[timesync]") {
  Random random(1);
  int found = 0;
  for (int run = 0; run < 100; ++run) {
    LowerEnvelope envelope;
    Stamp since;
    for (int i = 0; i < 100; ++i) {
      envelope.add({i * LowerEnvelope::kBinWidth.ns}, static_cast<std::int64_t>(random.uniform(0, 2e5)));
      // With few points the slope is still turning.
      if (i > 40) REQUIRE(!envelope.raised(8, 1e5, 16, since));
    }
    for (int i = 100; i < 120; ++i) {
      envelope.add({i * LowerEnvelope::kBinWidth.ns},
                   static_cast<std::int64_t>(1e6 + random.uniform(0, 2e5)));
      if (!envelope.raised(8, 1e5, 16, since)) continue;
      ++found;
      CHECK(since.ns == 100 * LowerEnvelope::kBinWidth.ns);
      break;
    }
  }
  CHECK(found == 100);
}

TEST_CASE("Delay quantiles are right to a quarter octave and forget", "[timesync]") {
  DelayHistogram delays;
  CHECK(delays.quantile(0.5).ns == 0);
  for (int i = 1; i <= 1000; ++i) delays.add({i * 1'000'000LL}, {i * 10'000LL});  // evenly to 10 ms
  CHECK(delays.quantile(0.5).ns >= 5'000'000);
  CHECK(delays.quantile(0.5).ns <= 5'950'000);
  CHECK(delays.quantile(0.99).ns >= 9'900'000);
  CHECK(delays.quantile(0.99).ns <= 11'780'000);
  for (int i = 0; i < 200; ++i) delays.add({(100 + i) * 1'000'000'000LL}, {5});
  CHECK(delays.quantile(1).ns == 1000);
}

TEST_CASE("Stamps rise, catch up, and are withheld when far ahead", "[timesync]") {
  RisingStamps rising;
  Stamp out;
  REQUIRE(rising.next({1'000'000'000}, {0}, out));
  // The map learnt that it had been 4 ms late: 5 ms later in device time is 1 ms later for the host.
  std::int64_t truth = 1'000'000'000 - 4'000'000;
  std::int64_t last = out.ns;
  for (int i = 1; i <= 4; ++i) {
    truth += 5'000'000;
    REQUIRE(rising.next({truth}, {5'000'000}, out));
    CHECK(out.ns > last);
    last = out.ns;
  }
  CHECK(out.ns == truth);
  CHECK(!rising.next({truth - 30'000'000}, {5'000'000}, out));
  CHECK(rising.next({truth + 1}, {5'000'000}, out));
}

}  // namespace
}  // namespace swiftlet
