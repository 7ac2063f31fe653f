#include "drivers/can/half_float.hpp"

#include <bit>

namespace swiftlet {
namespace {

constexpr std::uint32_t kExponentStep = 127 - 15;  // difference of the two exponent biases
constexpr std::uint32_t kInfinity32 = 0x7f800000U;

}  // namespace

float fromHalf(std::uint16_t half) {
  const std::uint32_t sign = (half & 0x8000U) << 16U;
  const std::uint32_t exponent = (half >> 10U) & 0x1fU;
  const std::uint32_t fraction = half & 0x3ffU;
  if (exponent == 0x1fU) return std::bit_cast<float>(sign | kInfinity32 | fraction << 13U);
  if (exponent == 0) {
    const float magnitude = static_cast<float>(fraction) * 0x1p-24F;
    return sign != 0 ? -magnitude : magnitude;
  }
  return std::bit_cast<float>(sign | (exponent + kExponentStep) << 23U | fraction << 13U);
}

std::uint16_t toHalf(float value) {
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(value);
  const std::uint32_t sign = bits >> 16U & 0x8000U;
  const std::uint32_t magnitude = bits & 0x7fffffffU;
  if (magnitude > kInfinity32) return static_cast<std::uint16_t>(sign | 0x7e00U);
  const float positive = std::bit_cast<float>(magnitude);
  if (positive >= 65520.0F) return static_cast<std::uint16_t>(sign | 0x7c00U);
  if (positive < 0x1p-14F) {
    // Adding 0.5 rounds to a multiple of 2^-24, because that is the last place of floats near 0.5.
    const float shifted = positive + 0.5F;
    return static_cast<std::uint16_t>(
        sign | (std::bit_cast<std::uint32_t>(shifted) - std::bit_cast<std::uint32_t>(0.5F)));
  }
  const std::uint32_t even = magnitude >> 13U & 1U;
  const std::uint32_t rounded = magnitude + 0xfffU + even;
  return static_cast<std::uint16_t>(sign | ((rounded >> 13U) - (kExponentStep << 10U)));
}

}  // namespace swiftlet
