#pragma once
// Quantiles of non-negative durations over the last one to two spans of the clock, in fixed memory.
//
// Quarter octaves from 1 us to 67 s: a quantile is right to 19 % (the upper edge of its bin is given). Two
// generations: the older one is forgotten when the newer has lasted `kGeneration`. add(): O(1); quantile():
// O(bins). Memory: 1 KiB.

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
  void clear() { *this = DelayHistogram(); }

 private:
  static constexpr Duration kGeneration = {32'000'000'000};  // as the clock maps' window
  static constexpr std::size_t kBins = 106;                  // 4 an octave, 26 octaves and both ends

  std::array<std::array<std::uint32_t, kBins>, 2> counts_{};
  Stamp begun_;
  bool any_ = false;
};

}  // namespace swiftlet
