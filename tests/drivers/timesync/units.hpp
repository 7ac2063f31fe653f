#pragma once
// The factor from milliseconds to the nanoseconds of stamps.

#include <cstdint>

namespace swiftlet::test {

inline constexpr std::int64_t kMs = 1'000'000;  // ns

}  // namespace swiftlet::test
