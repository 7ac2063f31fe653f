#pragma once
// Range of stamps that the clock maps accept.

#include <cstdint>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// 73 years. The clock maps refuse stamps beyond it, so that differences cannot overflow.
inline constexpr std::int64_t kStampLimit = std::int64_t{1} << 61U;
constexpr bool withinLimit(Stamp stamp) { return stamp.ns > -kStampLimit && stamp.ns < kStampLimit; }

}  // namespace swiftlet
