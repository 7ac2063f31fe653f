#pragma once
// Distribution of durations in fixed memory: logarithmic buckets from 100 ns to 100 s, 100 to a decade
// (percentiles to 1.2 %), with exact count, mean and maximum. add() costs a logarithm.

#include <array>
#include <cstddef>
#include <cstdint>

namespace swiftlet {

class LatencyHistogram {
 public:
  static constexpr std::size_t kPerDecade = 100;
  static constexpr std::size_t kDecades = 9;
  static constexpr double kSmallest = 1e-7;  ///< s; shorter durations count in the first bucket

  void add(double seconds);
  void add(const LatencyHistogram& other);

  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] double total() const { return total_; }  ///< s
  [[nodiscard]] double mean() const { return count_ == 0 ? 0 : total_ / static_cast<double>(count_); }
  [[nodiscard]] double max() const { return max_; }
  /// The value below which `share` (0 to 1) of the durations lie; 0 when empty.
  [[nodiscard]] double percentile(double share) const;
  /// Number of durations at or below `seconds`, to the resolution of a bucket.
  [[nodiscard]] std::uint64_t countUpTo(double seconds) const;

 private:
  std::array<std::uint32_t, kPerDecade * kDecades> buckets_{};
  std::uint64_t count_ = 0;
  double total_ = 0;
  double max_ = 0;
};

}  // namespace swiftlet
