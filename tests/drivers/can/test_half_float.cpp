#include <catch2/catch.hpp>

#include <cmath>
#include <cstdint>

#include "drivers/can/half_float.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

/// By the definition, with the library's own powers of two.
float definition(std::uint16_t half) {
  const int exponent = half >> 10 & 0x1f;
  const int fraction = half & 0x3ff;
  const float sign = (half & 0x8000) != 0 ? -1.0F : 1.0F;
  if (exponent == 31) return fraction != 0 ? std::nanf("") : sign * INFINITY;
  const int scale = exponent == 0 ? -24 : exponent - 25;
  return sign * std::ldexp(static_cast<float>(exponent == 0 ? fraction : fraction + 1024), scale);
}

TEST_CASE("All 65536 half floats become what their definition says, and back", "[can]") {
  int wrong = 0;
  for (std::uint32_t i = 0; i <= 0xffff; ++i) {
    const auto half = static_cast<std::uint16_t>(i);
    const float value = fromHalf(half);
    const float expected = definition(half);
    const bool nan = std::isnan(expected);
    wrong += nan ? !std::isnan(value) : !(value == expected && std::signbit(value) == std::signbit(expected));
    wrong += nan ? !std::isnan(fromHalf(toHalf(value))) : toHalf(value) != half;
  }
  CHECK(wrong == 0);
}

TEST_CASE("A float becomes the nearest half, the even one in a tie", "[can]") {
  Random random(3, 0);
  for (int i = 0; i < 20000; ++i) {
    const auto low = static_cast<std::uint16_t>(random.below(0x7bff));
    const float a = fromHalf(low);
    const float b = fromHalf(static_cast<std::uint16_t>(low + 1));
    const float middle = (a + b) / 2;
    const auto even = static_cast<std::uint16_t>(low % 2 == 0 ? low : low + 1);
    REQUIRE(toHalf(middle) == even);
    REQUIRE(toHalf(std::nextafter(middle, a)) == low);
    REQUIRE(toHalf(std::nextafter(middle, b)) == low + 1);
    REQUIRE(toHalf(-middle) == (even | 0x8000));
  }
  CHECK(toHalf(65519.0F) == 0x7bff);
  CHECK(toHalf(65520.0F) == 0x7c00);
  CHECK(toHalf(-INFINITY) == 0xfc00);
}

}  // namespace
}  // namespace swiftlet
