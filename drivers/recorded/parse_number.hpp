#pragma once
// Parses numbers and stamps without locale, allocation or loss: stamps never pass through double. Stamps
// beyond 4e18 ns (the year 2096) are refused.

#include <cstdint>
#include <string_view>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

inline constexpr std::int64_t kNsPerSecond = 1'000'000'000;

/// The whole of `text` as a double (a leading '+' allowed, "nan" and "inf" recognised).
[[nodiscard]] bool parseDouble(std::string_view text, double& value);

/// The whole of `text` as a decimal integer.
[[nodiscard]] bool parseInteger(std::string_view text, std::int64_t& value);

/// Decimal seconds ("1403636579.763555584") to nanoseconds, split at the point; digits after the ninth are
/// cut off. False for exponents, NaN and overflow.
[[nodiscard]] bool parseSeconds(std::string_view text, Stamp& stamp);

/// Nanoseconds with an optional fraction, which is cut off (ORB-SLAM3 writes them).
[[nodiscard]] bool parseNanoseconds(std::string_view text, Stamp& stamp);

/// A stamp in a csv file of the EuRoC family: an integer is nanoseconds, a number with a point is seconds.
[[nodiscard]] bool parseCsvStamp(std::string_view text, Stamp& stamp);

}  // namespace swiftlet
