#include "firmware_host/realtime/latency_histogram.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {

void LatencyHistogram::add(double seconds) {
  const double position = std::log10(std::max(seconds, kSmallest) / kSmallest) * kPerDecade;
  const auto bucket = std::min(static_cast<std::size_t>(position), buckets_.size() - 1);
  ++buckets_[bucket];
  ++count_;
  total_ += seconds;
  max_ = std::max(max_, seconds);
}

void LatencyHistogram::add(const LatencyHistogram& other) {
  for (std::size_t i = 0; i < buckets_.size(); ++i) buckets_[i] += other.buckets_[i];
  count_ += other.count_;
  total_ += other.total_;
  max_ = std::max(max_, other.max_);
}

double LatencyHistogram::percentile(double share) const {
  if (count_ == 0) return 0;
  const double wanted = share * static_cast<double>(count_);
  double below = 0;
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    below += buckets_[i];
    if (below >= wanted && buckets_[i] > 0) {
      // The bucket's geometric middle, but not above the maximum seen.
      const double middle = (static_cast<double>(i) + 0.5) / kPerDecade;
      return std::min(kSmallest * std::pow(10.0, middle), max_);
    }
  }
  return max_;
}

std::uint64_t LatencyHistogram::countUpTo(double seconds) const {
  // percentile() rises with its share, so the number of durations is found by bisection.
  const auto all = static_cast<double>(count());
  std::uint64_t low = 0;  // known to be at or below
  std::uint64_t high = count() + 1;
  while (high - low > 1) {
    const std::uint64_t middle = low + (high - low) / 2;
    (percentile(static_cast<double>(middle) / all) <= seconds ? low : high) = middle;
  }
  return low;
}

}  // namespace swiftlet
