#pragma once
// IEEE 754 binary16, in which DroneCAN sends small numbers.

#include <cstdint>

namespace swiftlet {

/// Exact.
[[nodiscard]] float fromHalf(std::uint16_t half);
/// To the nearest, ties to even; beyond 65504 infinity.
[[nodiscard]] std::uint16_t toHalf(float value);

}  // namespace swiftlet
