#pragma once
// Factors from the SI units of the code to the units of outputs: `seconds * kToMs`.

#include <cstddef>
#include <numbers>

namespace swiftlet {

inline constexpr double kToDegrees = 180.0 / std::numbers::pi;
inline constexpr double kToMs = 1e3;
inline constexpr double kToUs = 1e6;
inline constexpr double kFromMs = 1e-3;
inline constexpr double kFromUs = 1e-6;
inline constexpr double kPercent = 100;                          ///< in one
inline constexpr std::size_t kMebibyte = std::size_t{1} << 20U;  ///< bytes

}  // namespace swiftlet
