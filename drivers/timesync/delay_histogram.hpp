#pragma once
// Quantiles of non-negative durations over the last 32 to 64 s, in fixed memory.
//
// Bins of a quarter octave from 1 us to 67 s. A quantile is the upper edge of its bin, so its error is below
// 19 %. Two generations: the older one is dropped when the newer one is `kGeneration` long. Cost: add() O(1),
// quantile() O(bins). Memory: 1 KiB.

#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

class DelayHistogram {
 public:
  void add(Stamp when, Duration delay);
  /// `share` in [0, 1]; zero while empty.
  [[nodiscard]] Duration quantile(double share) const;

 private:
  static constexpr Duration kGeneration = {32'000'000'000};  // same as the window of the clock maps
  static constexpr std::size_t kBins = 106;                  // 4 per octave over 26 octaves, and both ends

  std::array<std::array<std::uint32_t, kBins>, 2> counts_{};
  Stamp begun_;
  bool any_ = false;
};

}  // namespace swiftlet
