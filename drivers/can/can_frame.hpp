#pragma once
// One frame of a CAN bus, classic or FD.

#include <array>
#include <cstdint>
#include <span>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct CanFrame {
  static constexpr std::size_t kClassicBytes = 8;
  static constexpr std::size_t kMaxBytes = 64;

  std::uint32_t id = 0;  ///< 29 bits, or 11 where not extended
  bool extended = true;
  bool fd = false;
  bool fast_data = false;  ///< FD only: the data at the higher bit rate
  std::uint8_t size = 0;
  std::array<std::uint8_t, kMaxBytes> data = {};

  /// CLOCK_MONOTONIC: when the kernel had it.
  Stamp arrival;

  [[nodiscard]] std::span<const std::uint8_t> bytes() const { return {data.data(), size}; }
};

/// The smallest number of bytes that an FD frame can carry and that `size` (at most 64) fits into.
[[nodiscard]] constexpr std::size_t fdFrameSize(std::size_t size) {
  constexpr std::array<std::size_t, 8> kSizes = {8, 12, 16, 20, 24, 32, 48, 64};
  if (size <= kSizes.front()) return size;
  for (const std::size_t possible : kSizes) {
    if (size <= possible) return possible;
  }
  return kSizes.back();
}

}  // namespace swiftlet
