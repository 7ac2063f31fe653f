#pragma once
// Shared by all RANSACs: drawing samples, and the number of samples needed.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "estimator/core/random.hpp"

namespace swiftlet {

/// `kCount` different indices below `bound` >= kCount, in random order.
template <std::size_t kCount>
std::array<std::size_t, kCount> drawSample(Random& random, std::size_t bound) {
  std::array<std::size_t, kCount> sample{};
  // Floyd's algorithm: one draw per element, without repetition.
  for (std::size_t i = 0; i < kCount; ++i) {
    const std::size_t top = bound - kCount + i;
    const std::size_t value = random.below(static_cast<std::uint32_t>(top + 1));
    const auto end = sample.begin() + static_cast<std::ptrdiff_t>(i);
    sample[i] = std::find(sample.begin(), end, value) == end ? value : top;
  }
  return sample;
}

/// Number of samples after which one of `sample_size` true tracks was drawn with probability `confidence` if
/// `inliers` of `count` are true (Fischler, Bolles 1981), at most `maximum`.
inline int samplesNeeded(std::size_t inliers, std::size_t count, int sample_size, double confidence,
                         int maximum) {
  if (count == 0 || inliers == 0) return maximum;
  const double share = static_cast<double>(inliers) / static_cast<double>(count);
  const double all_true = std::pow(share, sample_size);
  if (all_true >= 1.0) return 1;
  const double needed = std::log1p(-confidence) / std::log1p(-all_true);
  return needed < maximum ? std::max(1, static_cast<int>(std::ceil(needed))) : maximum;
}

}  // namespace swiftlet
