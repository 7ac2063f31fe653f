#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/median.hpp"
#include "estimator/core/random.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/core/status.hpp"

namespace swiftlet::test {

TEST_CASE("stamps are exact to the nanosecond at any epoch", "[core]") {
  const Stamp a{1'403'636'579'763'555'584};
  const Stamp b = a + Duration{1};
  CHECK(b > a);
  CHECK((b - a).ns == 1);
  CHECK((b - a).seconds() == 1e-9);
  CHECK(b - Duration{1} == a);
  CHECK((a - b) == -Duration{1});
}

TEST_CASE("durations convert from seconds by rounding, both signs", "[core]") {
  CHECK(Duration::fromSeconds(0.005).ns == 5'000'000);
  CHECK(Duration::fromSeconds(-0.005).ns == -5'000'000);
  CHECK(Duration::fromSeconds(1.6e-9).ns == 2);
  CHECK(Duration::fromSeconds(-1.6e-9).ns == -2);
  CHECK(Duration::fromSeconds(0).ns == 0);
  CHECK(Duration::fromMilliseconds(-3).ns == -3'000'000);
  CHECK(Duration::fromSeconds(Duration{123'456'789'012'345}.seconds()).ns == 123'456'789'012'345);
  CHECK((Duration{5} + Duration{7} - Duration{2}).ns == 10);
}

TEST_CASE("a fixed vector fills, refuses and empties", "[core]") {
  FixedVector<int, 3> v;
  CHECK(v.empty());
  CHECK(v.capacity() == 3);
  CHECK(v.tryPushBack(1));
  CHECK(v.tryPushBack(2));
  CHECK_FALSE(v.full());
  CHECK(v.tryPushBack(3));
  CHECK(v.full());
  CHECK_FALSE(v.tryPushBack(4));
  CHECK(v.size() == 3);
  CHECK(v.back() == 3);
  CHECK(v.front() == 1);
  v.popBack();
  CHECK(v.size() == 2);
  CHECK(v.tryPushBack(5));
  CHECK(v[2] == 5);
  v.clear();
  CHECK(v.empty());
  CHECK(v.begin() == v.end());
}

TEST_CASE("erasing keeps the order of the others", "[core]") {
  FixedVector<int, 5> v;
  for (int i = 0; i < 5; ++i) REQUIRE(v.tryPushBack(i));
  v.erase(1);
  v.erase(3);  // the last
  v.erase(0);
  REQUIRE(v.size() == 2);
  CHECK(v[0] == 2);
  CHECK(v[1] == 3);
  int sum = 0;
  for (const int x : v) sum += x;
  CHECK(sum == 5);
}

TEST_CASE("the median is the middle of the sorted values, the upper one of two", "[core]") {
  Random random(4);
  for (std::size_t size = 1; size < 40; ++size) {
    FixedVector<double, 40> values;
    while (values.size() < size) REQUIRE(values.tryPushBack(std::round(10 * random.normal())));
    FixedVector<double, 40> sorted = values;
    std::sort(sorted.begin(), sorted.end());
    REQUIRE(medianOf(values) == sorted[size / 2]);
  }
  CHECK(medianOf(std::array{4, 1, 3, 2}) == 3);
}

TEST_CASE("an image view finds its rows by stride", "[core]") {
  const std::array<std::uint8_t, 8> bytes = {0, 1, 2, 99, 4, 5, 6, 99};
  const ImageView view{bytes.data(), 3, 2, 4};
  CHECK_FALSE(view.empty());
  CHECK(view.row(1)[2] == 6);
  CHECK(ImageView{}.empty());
}

TEST_CASE("status", "[core]") {
  CHECK(okStatus().ok());
  CHECK_FALSE(Status{StatusCode::kDegenerate, "x"}.ok());
}

TEST_CASE("the generator gives PCG32's published numbers", "[core]") {
  // pcg32-demo of the reference implementation: seed 42, sequence 54.
  Random random(42, 54);
  for (const std::uint32_t expected :
       {0xa15c02b7U, 0x7b47f409U, 0xba1d3330U, 0x83d2f293U, 0xbfa4784bU, 0xcbed606eU}) {
    CHECK(random.next() == expected);
  }
}

TEST_CASE("seeds and sequences differ, equal ones repeat", "[core]") {
  Random a(1), b(1), c(2), d(1, 1);
  int equal_c = 0;
  int equal_d = 0;
  for (int i = 0; i < 1000; ++i) {
    const std::uint32_t value = a.next();
    CHECK(value == b.next());
    if (value == c.next()) ++equal_c;
    if (value == d.next()) ++equal_d;
  }
  CHECK(equal_c < 3);
  CHECK(equal_d < 3);
}

TEST_CASE("uniform numbers: range, moments, even spread", "[core]") {
  Random random(7);
  constexpr int kCount = 200000;
  double sum = 0;
  double squares = 0;
  std::array<int, 10> histogram{};
  for (int i = 0; i < kCount; ++i) {
    const double u = random.uniform();
    REQUIRE(u >= 0.0);
    REQUIRE(u < 1.0);
    sum += u;
    squares += u * u;
    ++histogram[static_cast<std::size_t>(u * 10)];
  }
  // 5 sigma of each estimate.
  CHECK(std::abs(sum / kCount - 0.5) < 5 * std::sqrt(1.0 / 12 / kCount));
  CHECK(std::abs(squares / kCount - 1.0 / 3) < 5 * std::sqrt(4.0 / 45 / kCount));
  double chi_squared = 0;
  for (const int n : histogram) chi_squared += std::pow(n - kCount / 10.0, 2) / (kCount / 10.0);
  CHECK(chi_squared < 33.7);  // 9 dof, probability 1e-4
}

TEST_CASE("bounded integers: every value, evenly", "[core]") {
  Random random(8);
  constexpr int kCount = 70000;
  std::array<int, 7> histogram{};
  for (int i = 0; i < kCount; ++i) ++histogram.at(random.below(7));
  double chi_squared = 0;
  for (const int n : histogram) chi_squared += std::pow(n - kCount / 7.0, 2) / (kCount / 7.0);
  CHECK(chi_squared < 27.9);  // 6 dof, probability 1e-4
  CHECK(random.below(1) == 0);
}

TEST_CASE("normal numbers: four moments, tails, independence", "[core]") {
  Random random(9);
  constexpr int kCount = 200000;
  double sum = 0, squares = 0, cubes = 0, fourths = 0, lagged = 0, last = 0;
  int beyond_two = 0;
  for (int i = 0; i < kCount; ++i) {
    const double x = random.normal();
    REQUIRE(std::isfinite(x));
    sum += x;
    squares += x * x;
    cubes += x * x * x;
    fourths += x * x * x * x;
    lagged += x * last;
    last = x;
    if (std::abs(x) > 2) ++beyond_two;
  }
  const double root = std::sqrt(static_cast<double>(kCount));
  CHECK(std::abs(sum / kCount) < 5 / root);
  CHECK(std::abs(squares / kCount - 1) < 5 * std::sqrt(2.0) / root);
  CHECK(std::abs(cubes / kCount) < 5 * std::sqrt(15.0) / root);
  CHECK(std::abs(fourths / kCount - 3) < 5 * std::sqrt(96.0) / root);
  CHECK(std::abs(lagged / kCount) < 5 / root);
  CHECK(std::abs(beyond_two / static_cast<double>(kCount) - 0.0455) < 5 * std::sqrt(0.0455) / root);
}

}  // namespace swiftlet::test
