#pragma once
// The stamps that inputs may have, in tables and bags alike.

#include <cstdint>

namespace swiftlet {

/// ns, the year 2096: the difference of two stamps, and a stamp and seconds, do not overflow.
inline constexpr std::int64_t kLargestStamp = 4'000'000'000'000'000'000;

constexpr bool isStampInRange(std::int64_t ns) { return ns <= kLargestStamp && ns >= -kLargestStamp; }

}  // namespace swiftlet
