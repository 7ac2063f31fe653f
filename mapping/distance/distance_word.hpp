#pragma once
// The two words of a cell of the distance field: layout and access.

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "mapping/distance/distance_sample.hpp"

namespace swiftlet {

/// In both words: which of the cells that share the slot the word belongs to, one bit per axis.
inline constexpr std::uint32_t kTagShift = 29;

/// The surface point inside a cell, 7 bits per axis, +-0.5 cells from its centre, and whether there is one;
/// the space of the cell; the axes along which it has surface on both sides; the tag.
struct StateWord {
  static constexpr float kScale = 126;  // 63 at half a cell
  static constexpr std::uint32_t kPresent = 1U << 21U;
  static constexpr std::uint32_t kSpaceShift = 22;
  static constexpr std::uint32_t kSidesShift = 24;

  static std::uint32_t pack(Space space) { return static_cast<std::uint32_t>(space) << kSpaceShift; }
  static std::uint32_t pack(Space space, const CellSurface& point) {
    std::uint32_t word = pack(space) | kPresent;
    for (int i = 0; i < 3; ++i) {
      const float kept = std::clamp(point.offset[i], -kMostOffset, kMostOffset) * kScale;
      const auto bits = static_cast<std::uint32_t>(std::lround(kept) + 64);
      word |= bits << (7U * static_cast<std::uint32_t>(i));
      if (point.both_sides[static_cast<std::size_t>(i)])
        word |= 1U << (kSidesShift + static_cast<std::uint32_t>(i));
    }
    return word;
  }
  static Space space(std::uint32_t word) { return static_cast<Space>(word >> kSpaceShift & 3U); }
  static bool isUnknown(std::uint32_t word) { return space(word) == Space::kUnknown; }
  static bool holds(std::uint32_t word, std::uint32_t tag) {
    return (word & kPresent) != 0 && word >> kTagShift == tag >> kTagShift;
  }
  /// Squared distance from a point to the surface of a cell whose centre is at `middle` relative to the
  /// point.
  static float squaredTo(std::uint32_t word, const Eigen::Vector3f& middle) {
    float squared = 0;
    for (std::uint32_t i = 0; i < 3; ++i) {
      const float offset = static_cast<float>(static_cast<int>(word >> (7U * i) & 127U) - 64) / kScale;
      const float to = middle[i];
      const bool both = (word >> (kSidesShift + i) & 1U) != 0;
      const float along = both ? std::abs(to) - std::abs(offset) : to + offset;
      squared += along * along;
    }
    return squared;
  }
};

/// Steps to the cell with the nearest surface, 7 bits per axis, biased by 64; if none is in reach, the
/// distance within which there is certainly none [cells]. The radius of known space [cells]. The tag.
struct NearestWord {
  static constexpr int kBias = 64;
  static constexpr std::uint32_t kHasSurface = 1U << 21U;
  static constexpr std::uint32_t kKnownShift = 22;
  /// Upper bound of the distance of surface from the centre of the cell that holds it [cells], and rounded
  /// up.
  static constexpr float kSpread = 1.5F;
  static constexpr int kSpreadCells = 2;

  static Eigen::Vector3i steps(std::uint32_t word) {
    return {static_cast<int>(word & 127U) - kBias, static_cast<int>(word >> 7U & 127U) - kBias,
            static_cast<int>(word >> 14U & 127U) - kBias};
  }
  static float atLeast(std::uint32_t word) { return static_cast<float>(word & 127U); }
  static int knownTo(std::uint32_t word) { return static_cast<int>(word >> kKnownShift & 127U); }
};

}  // namespace swiftlet
