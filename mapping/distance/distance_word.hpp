#pragma once
// The two words of a cell of the distance field: bits and how they are read.

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "mapping/distance/distance_sample.hpp"

namespace swiftlet {

/// In both: which of the places that share the slot it is of, one bit an axis.
inline constexpr std::uint32_t kTagShift = 29;

/// The surface point inside a cell, 7 bits an axis, +-0.5 cells from its middle, present or not; the
/// cell's space; the axes along which the cell has surface on both sides; the tag.
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
  /// From a point to the surface of a cell whose middle is at `middle` from it.
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

/// Steps to the cell with the nearest surface, 7 bits an axis, biased by 64, or, where none is in reach, how
/// far there is none for sure [cells]; how far nothing is unknown [cells]; the tag.
struct NearestWord {
  static constexpr int kBias = 64;
  static constexpr std::uint32_t kHasSurface = 1U << 21U;
  static constexpr std::uint32_t kKnownShift = 22;
  /// Surface lies up to so far from the middles of the cells that hold it [cells], rounded up too.
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
