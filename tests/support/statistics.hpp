#pragma once
// Figures of a list of numbers, for tests and benchmarks that print or bound them.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <vector>

namespace swiftlet::test {

/// The value below which `share` of the list lies, without interpolation: 0.5 the (lower) median, 1 the
/// largest. NaN for an empty list, so that no bound holds.
inline double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

/// NaN for an empty list.
inline double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

/// Largest difference of two pixels at the same place; the largest int if the lists are not of one length, so
/// that no bound holds.
inline int largestDifference(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b) {
  if (a.size() != b.size()) return std::numeric_limits<int>::max();
  int largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

}  // namespace swiftlet::test
