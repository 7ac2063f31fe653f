#pragma once
// How far stamps may be from zero where clocks are measured.

#include <cstdint>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// Stamps beyond this are refused by all that measures clocks, so that no difference overflows: 73 years.
inline constexpr std::int64_t kStampLimit = std::int64_t{1} << 61U;
constexpr bool withinLimit(Stamp stamp) { return stamp.ns > -kStampLimit && stamp.ns < kStampLimit; }

}  // namespace swiftlet
