#pragma once
// What the publisher under test and the independent subscriber agree on: message n is a function of n, so
// that a torn one shows.

#include <cstdint>

namespace swiftlet::test {

inline constexpr const char* kDdsPrefix = "/swiftlet";
inline constexpr const char* kDdsLabelTopic = "/segmentation/labels";
inline constexpr int kLabelWidth = 64;
inline constexpr int kLabelHeight = 48;

inline int pointsOf(std::uint64_t n) { return 3 * static_cast<int>(n % 700); }
inline std::uint8_t pixelOf(std::uint64_t n, std::size_t i) { return static_cast<std::uint8_t>(n * 7 + i); }

}  // namespace swiftlet::test
