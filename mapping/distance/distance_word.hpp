#pragma once
// The two words of a cell of the distance field: bits and how they are read.

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>

namespace swiftlet {

/// Where a cell's nearest surface is: offset to the cell that holds it, 7 bits an axis, biased by 64; the
/// cell's own space; whether it waits in the queue, and to raise; which of the places that share the slot it
/// is of.
struct NearestWord {
  static constexpr int kBias = 64;
  static constexpr std::uint32_t kOffsetMask = (1U << 21U) - 1;
  static constexpr std::uint32_t kSpaceShift = 21;
  static constexpr std::uint32_t kSpaceMask = 3U << kSpaceShift;
  static constexpr std::uint32_t kHasSurface = 1U << 23U;
  static constexpr std::uint32_t kRaise = 1U << 24U;
  static constexpr std::uint32_t kQueued = 1U << 25U;
  static constexpr std::uint32_t kParity = 1U << 26U;  ///< the surface's when it was taken
  static constexpr std::uint32_t kLink = kOffsetMask | kHasSurface | kParity;
  static constexpr std::uint32_t kTagShift = 27;  ///< one bit an axis

  static std::uint32_t pack(const Eigen::Vector3i& offset) {
    return static_cast<std::uint32_t>(offset.x() + kBias) |
           static_cast<std::uint32_t>(offset.y() + kBias) << 7U |
           static_cast<std::uint32_t>(offset.z() + kBias) << 14U;
  }
  static Eigen::Vector3i offset(std::uint32_t word) {
    return {static_cast<int>(word & 127U) - kBias, static_cast<int>(word >> 7U & 127U) - kBias,
            static_cast<int>(word >> 14U & 127U) - kBias};
  }
};

/// The surface point inside a cell: 8 bits an axis, +-1 cell from its middle; present or not; parity; the
/// tag.
struct SurfaceWord {
  static constexpr float kScale = 127;
  static constexpr std::uint32_t kPresent = 1U << 24U;
  static constexpr std::uint32_t kParity = 1U << 25U;  ///< turned when the point moves: dependants ask anew
  static constexpr std::uint32_t kTagShift = 26;

  static std::uint32_t pack(const Eigen::Vector3f& offset) {
    const auto byte = [](float value) {
      const float kept = std::clamp(value, -1.0F, 1.0F) * kScale;
      return static_cast<std::uint32_t>(static_cast<int>(std::lround(kept)) + 128);
    };
    return byte(offset.x()) | byte(offset.y()) << 8U | byte(offset.z()) << 16U | kPresent;
  }
  static Eigen::Vector3f offset(std::uint32_t word) {
    const auto value = [word](std::uint32_t shift) {
      return static_cast<float>(static_cast<int>(word >> shift & 255U) - 128) / kScale;
    };
    return {value(0), value(8), value(16)};
  }
};

}  // namespace swiftlet
