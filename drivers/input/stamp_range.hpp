#pragma once
// Largest stamp of inputs, for tables and bags.

#include <cstdint>

namespace swiftlet {

/// [ns], the year 2096. Neither the difference of two stamps nor a stamp plus some seconds overflows.
inline constexpr std::int64_t kLargestStamp = 4'000'000'000'000'000'000;

constexpr bool isStampInRange(std::int64_t ns) { return ns <= kLargestStamp && ns >= -kLargestStamp; }

}  // namespace swiftlet
