#pragma once
// IEEE 754 binary16, used by DroneCAN for small numbers.

#include <cstdint>

namespace swiftlet {

/// Exact conversion.
[[nodiscard]] float fromHalf(std::uint16_t half);
/// Rounds to nearest, ties to even; values above 65504 become infinity.
[[nodiscard]] std::uint16_t toHalf(float value);

}  // namespace swiftlet
