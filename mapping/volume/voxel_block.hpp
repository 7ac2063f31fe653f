#pragma once
// The voxels of a block, one array per quantity so that the update runs over rows.
//
// 5 bytes a voxel (2560 a block), and 8 more (4096) with labels.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "mapping/volume/block_index.hpp"

namespace swiftlet {

/// Steps of a distance from 0 to the truncation distance: 5 um at 15 cm.
inline constexpr float kDistanceSteps = 32767.0F;
/// Steps of a weight. An observation with the reference sigma has weight 1.
inline constexpr float kWeightSteps = 256.0F;
/// Weight of hints, in these steps: least, so that any image overrules them.
inline constexpr std::uint16_t kHintWeight = 1;

/// Rounds a distance to steps. Distances behind a surface by less than half a step stay behind it.
inline std::int16_t distanceOf(float steps) {
  const float cut = std::clamp(steps, -kDistanceSteps, kDistanceSteps);
  const auto whole = static_cast<int>(cut + (cut < 0 ? -0.5F : 0.5F));
  return static_cast<std::int16_t>(cut < 0 && whole == 0 ? -1 : whole);
}

struct alignas(64) VoxelBlock {
  std::array<std::int16_t, kBlockVoxels> distance;  ///< to the surface, positive in front of it
  std::array<std::uint16_t, kBlockVoxels> weight;   ///< 0: never observed
  std::array<std::uint8_t, kBlockVoxels> grey;
};

/// Counts of the labels seen at a voxel: four labels, each 5 bits of label and 11 of count. Sufficient for
/// Bayes' rule with any confusion model if a voxel saw at most four labels. A fifth label decrements the
/// rarest and replaces it at 0 (Misra, Gries, "Finding repeated elements", 1982).
class LabelCounts {
 public:
  static constexpr int kSlots = 4;
  static constexpr std::uint16_t kMostCount = (1U << 11U) - 1;

  /// `label` from 1 to 31. True if the most frequent label changed.
  bool add(std::uint8_t label);
  /// Adds the counts of another voxel of the same place; keeps the four most frequent labels of both.
  void add(const LabelCounts& other);
  /// Slots are ordered by descending count.
  [[nodiscard]] std::uint8_t label(int slot) const {
    return static_cast<std::uint8_t>(slots_[static_cast<std::size_t>(slot)] >> 11U);
  }
  [[nodiscard]] std::uint16_t count(int slot) const {
    return slots_[static_cast<std::size_t>(slot)] & kMostCount;
  }
  [[nodiscard]] bool empty() const { return slots_[0] == 0; }

  /// The representation in files, label << 11 | count each.
  using Words = std::array<std::uint16_t, kSlots>;
  [[nodiscard]] const Words& words() const { return slots_; }
  /// False, without effect, if add() cannot produce these words.
  [[nodiscard]] bool setWords(const Words& words);

 private:
  Words slots_{};  ///< filled from the front, by descending count
};

inline bool LabelCounts::setWords(const Words& words) {
  for (std::size_t i = 0; i < kSlots; ++i) {
    const bool one = words[i] >> 11U != 0 && (words[i] & kMostCount) != 0;
    if (!one && words[i] != 0) return false;
    if (i > 0 && (words[i] & kMostCount) > (words[i - 1] & kMostCount)) return false;
    for (std::size_t k = 0; one && k < i; ++k) {
      if (words[k] >> 11U == words[i] >> 11U) return false;
    }
  }
  slots_ = words;
  return true;
}

inline bool LabelCounts::add(std::uint8_t label) {
  std::size_t i = 0;
  while (i < kSlots && slots_[i] != 0 && slots_[i] >> 11U != label) ++i;
  if (i == kSlots) {
    // All slots are taken: the rarest label is decremented, and replaced when its count is used up.
    i = kSlots - 1;
    if ((slots_[i] & kMostCount) > 1) {
      --slots_[i];
    } else {
      slots_[i] = static_cast<std::uint16_t>((static_cast<unsigned>(label) << 11U) | 1U);
    }
    return false;
  }
  if (slots_[i] == 0) {
    slots_[i] = static_cast<std::uint16_t>((static_cast<unsigned>(label) << 11U) | 1U);
    return i == 0;
  }
  if ((slots_[i] & kMostCount) == kMostCount) {
    // Halving keeps the shares and lets newer labels count on.
    for (std::uint16_t& s : slots_) {
      if (s != 0) s = static_cast<std::uint16_t>((s & ~kMostCount) | (((s & kMostCount) + 1U) / 2U));
    }
  }
  ++slots_[i];
  if (i == 0 || (slots_[i] & kMostCount) <= (slots_[i - 1] & kMostCount)) return false;
  // Move past all labels of equal count.
  for (; i > 0 && (slots_[i] & kMostCount) > (slots_[i - 1] & kMostCount); --i)
    std::swap(slots_[i], slots_[i - 1]);
  return i == 0;
}

inline void LabelCounts::add(const LabelCounts& other) {
  if (empty()) {
    slots_ = other.slots_;
    return;
  }
  struct Seen {
    unsigned label = 0;
    unsigned count = 0;
  };
  std::array<Seen, std::size_t{2} * kSlots> seen{};
  std::size_t size = 0;
  for (const Words* words : {static_cast<const Words*>(&slots_), &other.slots_}) {
    for (const std::uint16_t word : *words) {
      if (word == 0) continue;
      std::size_t i = 0;
      const unsigned label = unsigned{word} >> 11U;
      while (i < size && seen[i].label != label) ++i;
      seen[i] = {label, seen[i].count + (word & kMostCount)};
      size = i == size ? size + 1 : size;
    }
  }
  std::sort(seen.begin(), seen.begin() + static_cast<std::ptrdiff_t>(size), [](const Seen& a, const Seen& b) {
    return a.count != b.count ? a.count > b.count : a.label < b.label;
  });
  // One divisor for all counts keeps their shares.
  const unsigned divisor = seen[0].count / (kMostCount + 1U) + 1U;
  for (std::size_t i = 0; i < kSlots; ++i) {
    const unsigned count = (seen[i].count + divisor - 1) / divisor;
    slots_[i] = i < size ? static_cast<std::uint16_t>(seen[i].label << 11U | count) : std::uint16_t{0};
  }
}

struct alignas(64) LabelBlock {
  std::array<LabelCounts, kBlockVoxels> counts;
};

}  // namespace swiftlet
