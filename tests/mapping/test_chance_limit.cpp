#include "mapping/pose_graph/chance_limit.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

TEST_CASE("The limit of chance counts the loops that can reach it, and no others", "[pose_graph]") {
  std::vector<double> all(100, std::log(1e-9));
  CHECK(std::exp(logChanceLimit(0.1, all)) == Approx(0.1 / 100));
  // 60 that could never prove anything.
  for (std::size_t k = 40; k < all.size(); ++k) all[k] = std::log(0.01);
  CHECK(std::exp(logChanceLimit(0.1, all)) == Approx(0.1 / 40));
  std::vector<double> none;
  CHECK(std::exp(logChanceLimit(0.1, none)) == Approx(0.1));
  std::vector<double> vague(50, 0.0);
  CHECK(std::exp(logChanceLimit(0.1, vague)) == Approx(0.1));
  // Three at 0.03: all three reach 0.1 / 3, none 0.1 / 4.
  std::vector<double> near(3, std::log(0.03));
  CHECK(std::exp(logChanceLimit(0.1, near)) == Approx(0.1 / 3));
  // Five at 0.03: five would reach 0.1 / 3, but then five count; at 0.1 / 4 none.
  std::vector<double> crowd(5, std::log(0.03));
  CHECK(std::exp(logChanceLimit(0.1, crowd)) == Approx(0.1 / 4));
}

TEST_CASE("Of random loops as many pass the limit as are said, however vague their tests", "[pose_graph]") {
  // A loop's chance is uniform in (0, 1) but never below its least.
  Random random(4);
  constexpr int kRuns = 2000;
  int believed = 0;
  for (int run = 0; run < kRuns; ++run) {
    std::vector<double> least(300);
    std::vector<double> found(300);
    for (std::size_t k = 0; k < least.size(); ++k) {
      least[k] = std::log(10.0) * random.uniform(-7, 0);
      found[k] = std::max(least[k], std::log(random.uniform()));
    }
    const double limit = logChanceLimit(0.1, least);
    for (const double chance : found) believed += chance <= limit ? 1 : 0;
  }
  // 200 expected at most, of deviation 14.
  CHECK(believed < 245);
  CHECK(believed > 150);
}

TEST_CASE("A chance that says little of one loop is enough for many", "[pose_graph]") {
  const double nothing = -std::numeric_limits<double>::infinity();
  // One of 1000 at 1e-4: a random one would be there in one of ten cases.
  std::vector<double> one{std::log(1e-4)};
  CHECK(logDiscoveryLimit(0.05, 1000, one) == nothing);
  CHECK(logDiscoveryLimit(0.1, 999, one) == one[0]);
  std::vector<double> three(3, std::log(1e-4));
  CHECK(logDiscoveryLimit(0.05, 1000, three) == three[0]);
  // A hundred beyond all doubt say nothing of the one at 1e-4, and are taken without it.
  std::vector<double> proven(100, std::log(1e-9));
  proven.push_back(std::log(1e-4));
  CHECK(logDiscoveryLimit(0.05, 1000, proven) == Approx(std::log(1e-9)));
  std::vector<double> none;
  CHECK(logDiscoveryLimit(0.05, 1000, none) == nothing);
}

TEST_CASE("Random loops come back as rarely as is said, and true ones do", "[pose_graph]") {
  Random random(5);
  constexpr int kRuns = 2000;
  constexpr std::size_t kRandom = 500;
  int spoiled = 0;
  std::size_t taken = 0;
  std::size_t false_taken = 0;
  for (int run = 0; run < kRuns; ++run) {
    std::vector<double> found(kRandom);
    for (double& chance : found) chance = std::log(random.uniform());
    std::vector<double> chances = found;
    const double alone = logDiscoveryLimit(0.05, kRandom, chances);
    spoiled += chances.front() <= alone ? 1 : 0;
    // A hundred true ones beside them, of chances too large for any to be believed alone (0.05 / 600).
    std::vector<double> all = found;
    for (int k = 0; k < 100; ++k) all.push_back(std::log(10.0) * random.uniform(-4, -3));
    const double limit = logDiscoveryLimit(0.05, all.size(), all);
    taken += static_cast<std::size_t>(std::upper_bound(all.begin(), all.end(), limit) - all.begin());
    for (const double chance : found) false_taken += chance <= limit ? 1U : 0U;
  }
  // 100 of 2000 expected at most, of deviation 10.
  CHECK(spoiled < 130);
  CHECK(spoiled > 50);
  CHECK(taken > 90 * kRuns);
  CHECK(static_cast<double>(false_taken) < 0.05 * static_cast<double>(taken));
}

}  // namespace
}  // namespace swiftlet
