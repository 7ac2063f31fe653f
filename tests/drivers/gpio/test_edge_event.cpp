#include <catch2/catch.hpp>

#include <limits>

#include "drivers/gpio/edge_event.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

constexpr std::int64_t kMs = 1'000'000;

TEST_CASE("Edges that lack by the sequence", "[gpio]") {
  EdgeGaps gaps;
  CHECK(gaps.add({{1}, true, 3}) == 2);  // the kernel counts from 1
  CHECK(gaps.add({{2}, true, 4}) == 0);
  CHECK(gaps.add({{3}, true, 10}) == 5);
  CHECK(gaps.add({{4}, true, 1}) == 0);  // began anew
  CHECK(gaps.add({{5}, true, 2}) == 0);
  CHECK(gaps.missed() == 7);
  EdgeGaps wrap;
  (void)wrap.add({{1}, true, 0xFFFFFFFF});
  CHECK(wrap.add({{2}, true, 0}) == 0);
  CHECK(wrap.add({{3}, true, 2}) == 1);
}

TEST_CASE("Edges that lack by the time, where events have no number", "[gpio]") {
  EdgeGaps gaps({50 * kMs});
  CHECK(gaps.add({{1000 * kMs}, true, std::nullopt}) == 0);
  CHECK(gaps.add({{1052 * kMs}, true, std::nullopt}) == 0);
  CHECK(gaps.add({{1202 * kMs}, true, std::nullopt}) == 2);
  CHECK(gaps.add({{1203 * kMs}, true, std::nullopt}) == 0);
  CHECK(gaps.add({{1100 * kMs}, true, std::nullopt}) == 0);
  CHECK(gaps.missed() == 2);
  EdgeGaps unknown;
  (void)unknown.add({{0}, true, std::nullopt});
  CHECK(unknown.add({{3000 * kMs}, true, std::nullopt}) == 0);
}

TEST_CASE("Any stamps are counted without overflow", "[gpio]") {
  Random random(2);
  EdgeGaps gaps({3});
  std::uint64_t sum = 0;
  for (int i = 0; i < 10'000; ++i) {
    constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
    const std::int64_t stamp = random.below(2) == 0 ? kMost - random.below(9) : -kMost - 1 + random.below(9);
    sum += gaps.add({{stamp}, true, random.below(2) == 0 ? std::optional(random.next()) : std::nullopt});
  }
  CHECK(sum == gaps.missed());
}

}  // namespace
}  // namespace swiftlet
