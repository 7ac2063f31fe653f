#include "drivers/timesync/delay_histogram.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

constexpr double kLowest = 1e3;  // ns
constexpr double kPerOctave = 4;

}  // namespace

void DelayHistogram::add(Stamp when, Duration delay) {
  if (!any_ || when < begun_) begun_ = when;
  any_ = true;
  if (when - begun_ > kGeneration) {
    counts_[1] = counts_[0];
    counts_[0].fill(0);
    begun_ = when;
  }
  const double octaves = std::log2(std::max(static_cast<double>(delay.ns), kLowest) / kLowest);
  const double bin = std::min(std::ceil(octaves * kPerOctave), static_cast<double>(kBins - 1));
  ++counts_[0][static_cast<std::size_t>(bin)];
}

Duration DelayHistogram::quantile(double share) const {
  std::uint64_t all = 0;
  for (std::size_t i = 0; i < kBins; ++i) all += std::uint64_t{counts_[0][i]} + counts_[1][i];
  if (all == 0) return {};
  const auto rank = static_cast<std::uint64_t>(share * static_cast<double>(all - 1)) + 1;
  std::uint64_t below = 0;
  std::size_t bin = 0;
  for (; bin + 1 < kBins; ++bin) {
    below += std::uint64_t{counts_[0][bin]} + counts_[1][bin];
    if (below >= rank) break;
  }
  return {static_cast<std::int64_t>(kLowest * std::exp2(static_cast<double>(bin) / kPerOctave))};
}

}  // namespace swiftlet
