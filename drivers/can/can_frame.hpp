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

  std::uint32_t id = 0;  ///< 29 bits if extended, else 11
  bool extended = true;
  bool fd = false;
  bool fast_data = false;  ///< FD only: data is sent at the higher bit rate
  std::uint8_t size = 0;
  std::array<std::uint8_t, kMaxBytes> data = {};

  /// CLOCK_MONOTONIC: when the kernel received the frame.
  Stamp arrival;

  [[nodiscard]] std::span<const std::uint8_t> bytes() const { return {data.data(), size}; }
};

/// The smallest FD frame length that holds `size` bytes (`size` at most 64).
[[nodiscard]] constexpr std::size_t fdFrameSize(std::size_t size) {
  constexpr std::array<std::size_t, 8> kSizes = {8, 12, 16, 20, 24, 32, 48, 64};
  if (size <= kSizes.front()) return size;
  for (const std::size_t possible : kSizes) {
    if (size <= possible) return possible;
  }
  return kSizes.back();
}

}  // namespace swiftlet
