// The predicates against determinants that are computed in another way: Leibniz's sums over the coordinates
// themselves, in 128 bits (|x| <= 2^25: 24 terms of 2^101).
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <limits>

#include "estimator/core/random.hpp"
#include "mesher/predicates.hpp"

using namespace swiftlet;  // NOLINT(google-build-using-namespace)

namespace {

using Wide = __int128;
constexpr std::int32_t kLargest = 1 << 25;

int signOf(Wide value) { return (value > 0 ? 1 : 0) - (value < 0 ? 1 : 0); }

/// Whole numbers, as the oracles take them.
struct Whole {
  std::int32_t x = 0;
  std::int32_t y = 0;
};

GridPoint gridOf(const Whole& p) { return {static_cast<double>(p.x), static_cast<double>(p.y)}; }

int orientationOracle(const Whole& a, const Whole& b, const Whole& c) {
  return signOf(Wide{a.x} * b.y + Wide{b.x} * c.y + Wide{c.x} * a.y - Wide{a.y} * b.x - Wide{b.y} * c.x -
                Wide{c.y} * a.x);
}

int inCircleOracle(const std::array<Whole, 4>& p) {
  std::array<int, 4> at = {0, 1, 2, 3};
  Wide sum = 0;
  do {
    int inversions = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t k = i + 1; k < 4; ++k) inversions += at[i] > at[k] ? 1 : 0;
    }
    const auto& x = p[static_cast<std::size_t>(at[0])];
    const auto& y = p[static_cast<std::size_t>(at[1])];
    const auto& z = p[static_cast<std::size_t>(at[2])];
    const Wide term = Wide{x.x} * y.y * (Wide{z.x} * z.x + Wide{z.y} * z.y);
    sum += inversions % 2 == 0 ? term : -term;
  } while (std::next_permutation(at.begin(), at.end()));
  return signOf(sum);
}

std::int32_t coordinate(Random& random, std::int32_t range) {
  return static_cast<std::int32_t>(random.below(2U * static_cast<std::uint32_t>(range) + 1U)) - range;
}

Whole pointIn(Random& random, std::int32_t range) {
  return {coordinate(random, range), coordinate(random, range)};
}

// Counts of each sign, so that a test of near-degenerate points shows that it met them.
struct Signs {
  std::array<int, 3> count{};
  void check(const std::array<Whole, 4>& p) {
    const std::array<GridPoint, 4> q = {gridOf(p[0]), gridOf(p[1]), gridOf(p[2]), gridOf(p[3])};
    const int turn = orientationOracle(p[0], p[1], p[2]);
    const double area = orientation(q[0], q[1], q[2]);
    const int side = inCircleOracle(p);
    if (signOf(static_cast<Wide>(area)) != turn || inCircle(q[0], q[1], q[2], q[3]) != side) {
      for (const Whole& w : p) UNSCOPED_INFO(w.x << ", " << w.y);
      CHECK(signOf(static_cast<Wide>(area)) == turn);
      CHECK(inCircle(q[0], q[1], q[2], q[3]) == side);
    }
    ++count[static_cast<std::size_t>(side + 1)];
  }
};

}  // namespace

TEST_CASE("predicates of a known triangle") {
  const GridPoint a{0, 0};
  const GridPoint b{4, 0};
  const GridPoint c{0, 2};
  CHECK(orientation(a, b, c) == 8);
  CHECK(orientation(b, a, c) == -8);
  CHECK(orientation(a, b, {9, 0}) == 0);
  CHECK(inCircle(a, b, c, {2, 1}) == 1);
  CHECK(inCircle(a, b, c, {4, 2}) == 0);
  CHECK(inCircle(a, b, c, {5, 2}) == -1);
  CHECK(inCircle(b, a, c, {2, 1}) == -1);
  CHECK(isBefore({1, 9}, {2, 0}));
  CHECK(isBefore({1, 0}, {1, 1}));
  CHECK_FALSE(isBefore({1, 1}, {1, 1}));
}

TEST_CASE("predicates of random points of every size") {
  Random random(1);
  for (const std::int32_t range : {1, 3, 20, 10'000, 1 << 20, kLargest}) {
    Signs signs;
    for (int i = 0; i < 10'000; ++i) {
      signs.check(
          {pointIn(random, range), pointIn(random, range), pointIn(random, range), pointIn(random, range)});
    }
    CHECK(signs.count[0] > 500);
    CHECK(signs.count[2] > 500);
  }
}

TEST_CASE("predicates do not overflow at the border of the range") {
  Random random(2);
  const std::array<std::int32_t, 5> values = {-kLargest, -kLargest + 1, 0, kLargest - 1, kLargest};
  const auto value = [&] { return values[random.below(5)]; };
  Signs signs;
  for (int i = 0; i < 20'000; ++i) {
    signs.check(
        {Whole{value(), value()}, Whole{value(), value()}, Whole{value(), value()}, Whole{value(), value()}});
  }
  for (const int count : signs.count) CHECK(count > 500);
}

TEST_CASE("predicates one grid step from a circle, and on it") {
  // Integer points on one circle: 65^2 = 63^2 + 16^2 = 60^2 + 25^2 = 56^2 + 33^2 = 52^2 + 39^2.
  const std::array<Whole, 5> arms = {Whole{65, 0}, {63, 16}, {60, 25}, {56, 33}, {52, 39}};
  Random random(3);
  Signs signs;
  for (int i = 0; i < 30'000; ++i) {
    const auto scale = static_cast<std::int32_t>(1 + random.below(300'000));
    const Whole centre = pointIn(random, kLargest - 65 * scale - 1);
    std::array<Whole, 4> p;
    for (Whole& q : p) {
      Whole arm = arms[random.below(5)];
      if (random.below(2) == 0) std::swap(arm.x, arm.y);
      const int sign_x = random.below(2) == 0 ? 1 : -1;
      const int sign_y = random.below(2) == 0 ? 1 : -1;
      q = {centre.x + scale * sign_x * arm.x, centre.y + scale * sign_y * arm.y};
    }
    if (random.below(3) != 0) p[random.below(4)].x += random.below(2) == 0 ? 1 : -1;
    signs.check(p);
  }
  for (const int count : signs.count) CHECK(count > 5'000);
}

TEST_CASE("orientation one grid step from a line, and on it") {
  Random random(4);
  std::array<int, 3> seen{};
  for (int i = 0; i < 30'000; ++i) {
    const Whole step = pointIn(random, 1 << 12);
    const Whole a = pointIn(random, kLargest / 2);
    const auto along = [&] {
      const std::int32_t k = coordinate(random, 1 << 12);
      return Whole{a.x + k * step.x, a.y + k * step.y};
    };
    const Whole b = along();
    Whole c = along();
    c.y += coordinate(random, 1);
    const int turn = orientationOracle(a, b, c);
    if (signOf(static_cast<Wide>(orientation(gridOf(a), gridOf(b), gridOf(c)))) != turn)
      CHECK(signOf(static_cast<Wide>(orientation(gridOf(a), gridOf(b), gridOf(c)))) == turn);
    ++seen[static_cast<std::size_t>(turn + 1)];
  }
  for (const int count : seen) CHECK(count > 5'000);
}

TEST_CASE("snapping to the grid") {
  GridPoint p{7, 7};
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  for (const float bad : {kNan, kInfinity, -kInfinity, 8193.0F, -1e30F}) {
    CHECK_FALSE(snapToGrid({bad, 0}, p));
    CHECK_FALSE(snapToGrid({0, bad}, p));
  }
  CHECK(p == GridPoint{7, 7});
  REQUIRE(snapToGrid({8192, -8192}, p));
  CHECK(p == GridPoint{kLargest, -kLargest});
  REQUIRE(snapToGrid({1.5F / 4096, 2.5F / 4096}, p));
  CHECK(p == GridPoint{2, 2});

  // From 2048 px on a float is a whole number of steps: nothing is moved. Below, by half a step at most.
  Random random(5);
  for (int i = 0; i < 10'000; ++i) {
    const auto u = static_cast<float>(random.uniform(2048, 8192));
    const auto v = static_cast<float>(random.uniform(-2048, 2048));
    REQUIRE(snapToGrid({u, v}, p));
    REQUIRE(p.x == static_cast<double>(u) * 4096);
    REQUIRE(std::abs(p.y - static_cast<double>(v) * 4096) <= 0.5);
  }
}
