// Latency percentiles against exact order statistics.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "estimator/core/random.hpp"
#include "firmware_host/realtime/latency_histogram.hpp"

namespace swiftlet {
namespace {

TEST_CASE("percentiles lie within a bucket of the exact ones") {
  Random random(1);
  LatencyHistogram histogram;
  std::vector<double> all;
  for (int i = 0; i < 20000; ++i) {
    const double seconds = 2e-3 * std::exp(0.8 * random.normal());
    histogram.add(seconds);
    all.push_back(seconds);
  }
  std::ranges::sort(all);
  double sum = 0;
  for (const double s : all) sum += s;
  CHECK(histogram.count() == all.size());
  CHECK(histogram.mean() == Approx(sum / 20000));
  CHECK(histogram.max() == all.back());
  for (const double share : {0.01, 0.5, 0.9, 0.99, 0.999}) {
    const double exact = all[static_cast<std::size_t>(share * 20000)];
    CHECK(histogram.percentile(share) == Approx(exact).epsilon(0.025));
  }
  CHECK(histogram.percentile(1) == Approx(all.back()).epsilon(0.025));
}

TEST_CASE("empty, tiny and huge durations") {
  LatencyHistogram histogram;
  CHECK(histogram.percentile(0.5) == 0);
  CHECK(histogram.mean() == 0);
  histogram.add(0);
  histogram.add(1e-9);
  CHECK(histogram.percentile(0.99) <= 1.1e-7);
  histogram.add(1e6);
  CHECK(histogram.max() == 1e6);
  CHECK(histogram.percentile(0.1) < 1e-6);
}

}  // namespace
}  // namespace swiftlet
